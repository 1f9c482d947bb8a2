# SPDX-License-Identifier: GPL-3.0-or-later
"""Functions of plain Python as functions of Warp, rewritten from their own source over the syntax tree.

The laws of contact, friction and effects stand once, as functions of numbers that numba compiles. Warp compiles a smaller
language with strict types. The rewriting changes no arithmetic, so that both give the same bits in float64:

* literals and constants of a module get the type of the numbers, or become 32-bit integers;
* ``math.sqrt`` becomes ``wp.sqrt``, and so on; `min` and `max` of several numbers are nested;
* loops over constant tuples are unrolled, their entries put in, tuples are taken apart, named tuples become structs;
* ``np.zeros`` becomes an array of one thread, whose shape is constant;
* a function that is called is translated too.

An array has as many axes as the source has indices for it.
"""

from __future__ import annotations

import ast
import inspect
import linecache
import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from types import GenericAlias, ModuleType
from typing import Any

import numpy as np

from ...compiled.kernels import plain
from .block import IN_CUDA, THREADS

REAL, INTEGER, BOOLEAN, OTHER = "real", "integer", "boolean", "other"
"""Kinds of values, as far as the rewriting has to tell them apart."""
KIND_OF_ANNOTATION = {"float": REAL, "int": INTEGER, "bool": BOOLEAN, "np.ndarray": REAL}
ARRAYS = {"np.ndarray": REAL, "IntArray": INTEGER, "BoolArray": BOOLEAN}
"""Names of annotations of arrays, and the kind of what they hold."""
SAME_IN_WARP = ("min", "max", "abs", "range", "len")
NATIVE = {"expm1": "x", "log1p": "x", "hypot": "x, y", "copysign": "x, y"}
"""Functions of C that Warp does not have, and their arguments."""


class TranslationError(RuntimeError):
    """A function uses what the rewriting does not know; a law that numba compiles may need another wording."""


def fields_of(kind: type) -> dict[str, str]:
    """Return the annotations of a named tuple's fields as text; one without annotations holds floats."""
    known = {name: text for one in reversed(kind.__mro__) for name, text in vars(one).get("__annotations__", {}).items()}
    return {
        name: str(getattr(known.get(name), "__forward_arg__", known.get(name, "float")))
        for name in kind._fields  # type: ignore[attr-defined]
    }


class Translation:
    """Functions, structs and kernels of Warp, for numbers of one type.

    Parameters
    ----------
    warp : module
    real : type
        ``warp.float64`` or ``warp.float32``.
    name : str
        Part of the names of the Warp modules; each is compiled once, and again only when its source changes.
    instead : mapping, optional
        Functions and numbers by the names for which they stand in every source.
    """

    def __init__(self, warp: ModuleType, real: Any, name: str, instead: Mapping[str, Any] | None = None):
        self.warp, self.real, self.name = warp, real, f"palpate_{name}_{real.__name__}"
        self.instead = dict(instead or {})
        self._functions: dict[Any, Any] = {}
        self.structs: dict[type, Any] = {}
        self._kernels: dict[Callable[..., Any], Any] = {}

    def function(self, function: Callable[..., Any]) -> Any:
        """Return a function of plain Python, or a kernel of numba, as a function of Warp."""
        source = plain(function)
        if source not in self._functions:
            name = f"{source.__module__.rpartition('.')[2]}_{source.__name__.strip('_')}"
            if source in IN_CUDA:
                arguments = list(inspect.signature(source).parameters)
                alone = f"return {arguments[0]};" if arguments else ""
                self._functions[source] = self._native(name, arguments, IN_CUDA[source], alone)
            else:
                self._functions[source] = self._compiled(source, name, self.warp.func, None)
        return self._functions[source]

    def kernel(self, function: Callable[..., Any], threads: int, block: int = THREADS, registers: int | None = None) -> Any:
        """Return a function as a kernel of Warp; those of one Python module with blocks of one size are compiled together.

        Parameters
        ----------
        function : callable
        threads : int
            How many of its arguments, from the first, are the index of a thread.
        block : int
            Threads of a block on a GPU.
        registers : int, optional
            Most registers of a thread on a GPU; fewer let more threads run at a time.
        """
        if function not in self._kernels:
            module = self.warp.get_module(f"{self.name}_{function.__module__.rpartition('.')[2]}_{block}")
            options = {"enable_backward": False, "fuse_fp": False, "optimization_level": 3, "block_dim": block}
            self.warp.set_module_options(options, module=module)
            decorate = self.warp.kernel(
                enable_backward=False, module=module, grid_stride=False, cuda_max_registers=registers
            )  # fmt: skip
            self._kernels[function] = self._compiled(function, function.__name__.strip("_"), decorate, threads)
        return self._kernels[function]

    def struct(self, kind: type, example: Any = None) -> Any:
        """Return a named tuple as a struct of Warp: of numbers or, like an example, also of arrays."""
        if kind not in self.structs:
            fields = {name: self._field(text, name, example) for name, text in fields_of(kind).items()}
            made = type(kind.__name__, (), {"__annotations__": fields, "__module__": self.name})
            self.structs[kind] = self.warp.struct(made)
        return self.structs[kind]

    def value(self, example: Any, device: str) -> Any:
        """Return a named tuple of numbers and arrays as a value of its struct, with the arrays on a device."""
        made = self.struct(type(example), example)()
        for name, value in zip(type(example)._fields, example, strict=True):
            setattr(made, name, self.array(value, device) if isinstance(value, np.ndarray) else value)
        return made

    def room(self, example: Any, count: int, device: str) -> Any:
        """Return the arrays of many environments as a value of their struct, given those of one, each full of one number."""
        made = self.struct(type(example), example)()
        for name, values in zip(type(example)._fields, example, strict=True):
            shape, kind = (count, *values.shape[1:]), self.type_of(values)
            setattr(made, name, self.warp.full(shape, values.item(0), dtype=kind, device=device))
        return made

    def bytes_of(self, *parts: Any) -> int:
        """Return how much memory of a device the arrays of named tuples take."""
        size = self.warp.types.type_size_in_bytes
        return sum(one.size * size(self.type_of(one)) for part in parts for one in part if isinstance(one, np.ndarray))

    def array(self, values: np.ndarray, device: str) -> Any:
        """Return a copy of an array on a device, with numbers of this translation's types."""
        return self.warp.array(values, dtype=self.type_of(values), device=device)

    def type_of(self, values: np.ndarray) -> Any:
        """Return the type of Warp that the entries of an array get."""
        return self.number_type({"f": REAL, "b": BOOLEAN}.get(values.dtype.kind, INTEGER))

    def number_type(self, kind: str) -> Any:
        """Return the type of Warp of a kind of numbers."""
        return {REAL: self.real, INTEGER: self.warp.int32, BOOLEAN: self.warp.bool}[kind]

    def annotation(self, text: str, axes: int, owner: Mapping[str, Any]) -> Any:
        """Return the type of Warp for an annotation of the source."""
        if text in ARRAYS:
            return self.warp.array(dtype=self.number_type(ARRAYS[text]), ndim=max(axes, 1))
        if text.startswith("tuple"):
            return self.warp.types.vector(length=max(axes, text.count("float")), dtype=self.real)
        if text in KIND_OF_ANNOTATION:
            return self.number_type(KIND_OF_ANNOTATION[text])
        named = owner.get(text)
        if isinstance(named, type) and hasattr(named, "_fields"):
            return self.struct(named)
        raise TranslationError(f"An argument is annotated '{text}', which has no type in Warp.")

    def native(self, name: str) -> Any:
        """Return a function of C as a function of Warp."""
        if name not in self._functions:
            calls = (f"return {prefix}{name}({NATIVE[name]});" for prefix in ("::", "__builtin_"))
            self._functions[name] = self._native(name, NATIVE[name].split(", "), *calls)
        return self._functions[name]

    def _native(self, name: str, arguments: Sequence[str], in_cuda: str, in_c: str) -> Any:
        """Return a function of real numbers as a function of Warp, given its body for a GPU and for a processor."""
        snippet = f"#ifdef __CUDA_ARCH__\n{in_cuda}\n#else\n{in_c}\n#endif\n"
        header, result = ", ".join(f"{one}: real" for one in arguments), " -> real" if arguments else ""
        text = f"@wp.func_native(snippet)\ndef {name}({header}){result}: ...\n"
        return self._executed(text, name, {"snippet": snippet})

    def _field(self, text: str, name: str, example: Any) -> Any:
        if text in ARRAYS:
            values = getattr(example, name)
            return self.warp.array(dtype=self.type_of(values), ndim=values.ndim)
        return self.number_type(KIND_OF_ANNOTATION[text])

    def _compiled(self, source: Callable[..., Any], name: str, decorate: Callable[[Any], Any], threads: int | None) -> Any:
        tree = ast.parse(textwrap.dedent(inspect.getsource(source))).body[0]
        assert isinstance(tree, ast.FunctionDef)
        rewriter = _Rewriter(self, tree, {**source.__globals__, **self.instead})
        body = rewriter.body()
        arguments = [argument.arg for argument in tree.args.args]
        annotations = rewriter.annotations()
        if threads is not None:
            index = ", ".join(arguments[:threads])
            body = [*ast.parse(f"{index} = wp.tid()").body, *body]
            arguments = arguments[threads:]
        header = ast.parse(f"def {name}({', '.join(arguments)}): pass").body[0]
        assert isinstance(header, ast.FunctionDef)
        header.body = body
        text = ast.unparse(ast.fix_missing_locations(header)) + "\n"
        made = self._executed(text, name, rewriter.scope)
        made.__annotations__ = {argument: annotations[argument] for argument in arguments}
        return decorate(made)

    def _executed(self, text: str, name: str, scope: Mapping[str, Any]) -> Any:
        """Return the function that a text defines; Warp reads the text again."""
        file = f"<{self.name}.{name}>"
        linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
        known = {"wp": self.warp, "real": self.real, "__name__": self.name, **scope}
        exec(compile(text, file, "exec"), known)
        return known[name]


class _Rewriter:
    """Rewrites one function.

    Parameters
    ----------
    translation : Translation
    tree : ast.FunctionDef
    outside : dict
        The globals of the function.
    """

    def __init__(self, translation: Translation, tree: ast.FunctionDef, outside: Mapping[str, Any]):
        self._translation, self._tree, self._outside = translation, tree, outside
        self.scope: dict[str, Any] = {}
        self._temporaries = 0
        self._text = {one.arg: self._named_text(ast.unparse(one.annotation)) for one in tree.args.args if one.annotation}
        self._kinds = {name: KIND_OF_ANNOTATION.get(text, OTHER) for name, text in self._text.items()}
        self._arrays = {name: ARRAYS[text] for name, text in self._text.items() if text in ARRAYS}
        self._axes = self._count_axes()

    def annotations(self) -> dict[str, Any]:
        """Return the types of the arguments."""
        return {
            argument.arg: self._translation.annotation(self._text[argument.arg], self._axes.get(argument.arg, 0), self._outside)
            for argument in self._tree.args.args
        }

    def body(self) -> list[ast.stmt]:
        """Return the statements, rewritten."""
        return self._block(self._tree.body)

    # --- what is known of names

    def _named_text(self, text: str) -> str:
        """Return an annotation, written out where it is the name of a kind of tuple."""
        named = self._outside.get(text)
        return str(named) if isinstance(named, GenericAlias) else text

    def _count_axes(self) -> dict[str, int]:
        """Return how many axes each array has, and how many entries each tuple that is indexed."""
        axes: dict[str, int] = {}
        for node in ast.walk(self._tree):
            if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name):
                name, index = node.value.id, node.slice
                if self._text.get(name, "").startswith("tuple"):
                    assert isinstance(index, ast.Constant) and isinstance(index.value, int)
                    axes[name] = max(axes.get(name, 0), index.value + 1)
                else:
                    axes[name] = max(axes.get(name, 0), len(index.elts) if isinstance(index, ast.Tuple) else 1)
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
                self._axes_of_callee(node, axes)
        return axes

    def _axes_of_callee(self, call: ast.Call, axes: dict[str, int]) -> None:
        """Take over the axes that a function expects of arrays it is given."""
        assert isinstance(call.func, ast.Name)
        callee = self._outside.get(call.func.id)
        if not callable(callee) or isinstance(callee, type) or call.func.id in SAME_IN_WARP:
            return
        source = plain(callee)
        tree = ast.parse(textwrap.dedent(inspect.getsource(source))).body[0]
        assert isinstance(tree, ast.FunctionDef)
        inner = _Rewriter(self._translation, tree, {**source.__globals__, **self._translation.instead})
        for given, argument in zip(call.args, tree.args.args, strict=False):
            found = inner._axes.get(argument.arg, 0)
            if isinstance(given, ast.Name):
                axes[given.id] = max(axes.get(given.id, 0), found)
            elif isinstance(given, ast.Subscript) and isinstance(given.value, ast.Name) and found:
                taken = len(given.slice.elts) if isinstance(given.slice, ast.Tuple) else 1
                axes[given.value.id] = max(axes.get(given.value.id, 0), found + taken)

    def _constant(self, name: str) -> Any:
        """Return a number that a name stands for outside the function, or None."""
        value = None if name in self._kinds else self._outside.get(name)
        return value if isinstance(value, bool | int | float) else None

    def _constant_entry(self, node: ast.Subscript) -> Any:
        """Return an entry of a tuple of numbers outside the function, or None."""
        if isinstance(node.value, ast.Name) and isinstance(node.slice, ast.Constant):
            values = self._outside.get(node.value.id)
            if isinstance(values, tuple) and node.value.id not in self._kinds:
                return values[node.slice.value]  # type: ignore[index]
        return None

    def _kind(self, node: ast.expr) -> str:
        """Return the kind of an expression of the source."""
        if isinstance(node, ast.Constant):
            value = node.value
            return BOOLEAN if isinstance(value, bool) else INTEGER if isinstance(value, int) else REAL
        if isinstance(node, ast.Name):
            value = self._constant(node.id)
            return self._kinds.get(node.id, OTHER) if value is None else self._kind(ast.Constant(value))
        if isinstance(node, ast.Compare | ast.BoolOp):
            return BOOLEAN
        if isinstance(node, ast.UnaryOp):
            return BOOLEAN if isinstance(node.op, ast.Not) else self._kind(node.operand)
        if isinstance(node, ast.BinOp):
            both = {self._kind(node.left), self._kind(node.right)}
            return INTEGER if both == {INTEGER} and not isinstance(node.op, ast.Div) else REAL
        if isinstance(node, ast.IfExp):
            both = {self._kind(node.body), self._kind(node.orelse)}
            return both.pop() if len(both) == 1 else REAL
        if isinstance(node, ast.Subscript):
            return self._kind_of_entry(node)
        if isinstance(node, ast.Call):
            return self._kind_of_call(node)
        return self._kind_of_attribute(node) if isinstance(node, ast.Attribute) else OTHER

    def _kind_of_entry(self, node: ast.Subscript) -> str:
        """Return the kind of an entry of an array; a row of it is OTHER."""
        value, taken = node.value, len(node.slice.elts) if isinstance(node.slice, ast.Tuple) else 1
        if isinstance(value, ast.Name) and self._text.get(value.id, "").startswith("tuple"):
            return REAL
        if isinstance(value, ast.Attribute):
            kind, axes = self._field_array(value)
        elif isinstance(value, ast.Name):
            kind, axes = self._arrays.get(value.id, REAL), self._axes.get(value.id, 1)
        else:
            return REAL
        return kind if taken >= axes else OTHER

    def _field_array(self, node: ast.Attribute) -> tuple[str, int]:
        """Return the kind of the entries of a struct's array, and how many axes it has."""
        if node.attr == "shape":
            return INTEGER, 1
        kind = self._struct_of(node.value)
        if kind not in self._translation.structs:
            raise TranslationError(f"'{ast.unparse(node)}' belongs to a struct without an example of its arrays.")
        field = self._translation.structs[kind].vars[node.attr].type
        warp = self._translation.warp
        return {warp.int32: INTEGER, warp.bool: BOOLEAN}.get(field.dtype, REAL), field.ndim

    def _struct_of(self, node: ast.expr) -> Any:
        """Return the named tuple of which a name stands for one."""
        kind = self._outside.get(self._text.get(node.id, "")) if isinstance(node, ast.Name) else None
        return kind if isinstance(kind, type) and hasattr(kind, "_fields") else None

    def _kind_of_attribute(self, node: ast.Attribute) -> str:
        kind = self._struct_of(node.value)
        text = "float" if kind is None else fields_of(kind).get(node.attr, "float")
        return OTHER if text in ARRAYS else KIND_OF_ANNOTATION.get(text, OTHER)

    def _kind_of_call(self, node: ast.Call) -> str:
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        if _is_new_array(node):
            return OTHER
        if name in ("int", "len"):
            return INTEGER
        if name in ("min", "max", "abs"):
            kinds = {self._kind(one) for one in node.args}
            return kinds.pop() if len(kinds) == 1 else REAL
        callee = self._outside.get(name)
        if callee is not None and not isinstance(callee, type):
            return KIND_OF_ANNOTATION.get(str(plain(callee).__annotations__.get("return", "")), OTHER)
        return OTHER if name else REAL

    # --- statements

    def _block(self, body: list[ast.stmt]) -> list[ast.stmt]:
        return [new for statement in body for new in self._statement(statement)]

    def _statement(self, node: ast.stmt) -> list[ast.stmt]:
        if isinstance(node, ast.Expr):
            return [] if isinstance(node.value, ast.Constant) else [ast.Expr(self._expression(node.value))]
        if isinstance(node, ast.Assign):
            return [new for target in node.targets for new in self._assign(target, node.value)]
        if isinstance(node, ast.AugAssign):
            value = ast.BinOp(_loaded(node.target), node.op, node.value)
            return self._assign(node.target, value)
        if isinstance(node, ast.Return):
            return [ast.Return(None if node.value is None else self._returned(node.value))]
        if isinstance(node, ast.If):
            return self._branch(node)
        if isinstance(node, ast.While):
            return [ast.While(self._expression(node.test), self._block(node.body), [])]
        if isinstance(node, ast.For):
            return self._loop(node)
        if isinstance(node, ast.Break | ast.Continue | ast.Pass):
            return [node]
        raise TranslationError(f"'{ast.unparse(node)}' has no translation.")

    def _branch(self, node: ast.If) -> list[ast.stmt]:
        """Return a branch; numbers that it introduces exist before it, since Warp joins only such after a branch."""
        before, test = set(self._kinds), self._expression(node.test)
        new = ast.If(test, self._block(node.body), self._block(node.orelse))
        zeros = {
            REAL: _number(0.0),
            INTEGER: ast.parse("int(0)", mode="eval").body,
            BOOLEAN: ast.parse("bool(False)", mode="eval").body,
        }
        fresh = [name for name in self._kinds if name not in before and self._kinds[name] in zeros]
        return [*(ast.Assign([ast.Name(name, ast.Store())], zeros[self._kinds[name]]) for name in fresh), new]

    def _returned(self, value: ast.expr) -> ast.expr:
        value, wanted = _tuple_of_choices(value), ast.unparse(self._tree.returns) if self._tree.returns else ""
        if isinstance(value, ast.Tuple):
            kinds = _kinds_of_results(wanted, len(value.elts))
            return ast.Tuple([self._as(kind, one) for kind, one in zip(kinds, value.elts, strict=True)], ast.Load())
        return self._as(KIND_OF_ANNOTATION.get(wanted, OTHER), value)

    def _loop(self, node: ast.For) -> list[ast.stmt]:
        assert isinstance(node.target, ast.Name)
        if isinstance(node.iter, ast.Name) and isinstance(self._outside.get(node.iter.id), tuple):
            unrolled: list[ast.stmt] = []
            for value in self._outside[node.iter.id]:
                unrolled += self._block([_WithConstant(node.target.id, value).visit(_copy(one)) for one in node.body])
            return unrolled
        self._kinds[node.target.id] = INTEGER
        return [ast.For(node.target, self._expression(node.iter), self._block(node.body), [])]

    def _assign(self, target: ast.expr, value: ast.expr) -> list[ast.stmt]:
        if not isinstance(target, ast.Tuple):
            return self._assign_one(target, value)
        value = _tuple_of_choices(value)
        if isinstance(value, ast.Tuple):
            return self._assign_at_once(target.elts, value.elts)
        if isinstance(value, ast.Call):
            return self._assign_call(target, value)
        fields = self._parts(value, len(target.elts))
        return [new for one, part in zip(target.elts, fields, strict=True) for new in self._assign(one, part)]

    def _parts(self, value: ast.expr, count: int) -> list[ast.expr]:
        """Return the entries of a tuple that has a name."""
        if isinstance(value, ast.Name):
            kind = self._outside.get(self._text.get(value.id, ""))
            if isinstance(kind, type) and hasattr(kind, "_fields"):
                return [ast.Attribute(value, field, ast.Load()) for field in kind._fields]
        return [ast.Subscript(value, ast.Constant(i), ast.Load()) for i in range(count)]

    def _assign_at_once(self, targets: list[ast.expr], values: list[ast.expr]) -> list[ast.stmt]:
        """Assign several values, which all are those before the first assignment."""
        written = {_name_of(one) for one in targets if not isinstance(one, ast.Tuple)}
        read = {node.id for value in values for node in ast.walk(value) if isinstance(node, ast.Name)}
        if not written & read:
            return [new for one, value in zip(targets, values, strict=True) for new in self._assign(one, value)]
        statements: list[ast.stmt] = []
        temporaries: list[ast.expr] = []
        for value in values:
            name = self._temporary()
            statements += self._assign(ast.Name(name, ast.Store()), value)
            temporaries.append(ast.Name(name, ast.Load()))
        return statements + [new for one, value in zip(targets, temporaries, strict=True) for new in self._assign(one, value)]

    def _assign_call(self, target: ast.Tuple, value: ast.Call) -> list[ast.stmt]:
        """Assign the results of a function to names, and from there to entries of arrays."""
        callee = self._outside.get(value.func.id) if isinstance(value.func, ast.Name) else None
        annotation = "" if callee is None else str(plain(callee).__annotations__.get("return", ""))
        names: list[ast.expr] = []
        after: list[ast.stmt] = []
        for one, kind in zip(target.elts, _kinds_of_results(annotation, len(target.elts)), strict=True):
            name = one.id if isinstance(one, ast.Name) and one.id != "_" else self._temporary()
            self._kinds[name] = kind
            names.append(ast.Name(name, ast.Store()))
            if not isinstance(one, ast.Name):
                after += self._assign_one(one, ast.Name(name, ast.Load()))
        return [ast.Assign([ast.Tuple(names, ast.Store())], self._expression(value)), *after]

    def _temporary(self) -> str:
        self._temporaries += 1
        return f"t_{self._temporaries}"

    def _assign_one(self, target: ast.expr, value: ast.expr) -> list[ast.stmt]:
        if isinstance(target, ast.Name):
            self._note(target.id, value)
            kind = self._kinds.get(target.id)
            if kind not in (REAL, INTEGER, BOOLEAN) or target.id not in self._kinds:
                kind = self._kind(value)
                self._kinds[target.id] = kind
            return [ast.Assign([target], self._as(kind, value))]
        kind = self._kind(target)
        return [ast.Assign([self._expression(target)], self._as(kind, value))]

    def _note(self, name: str, value: ast.expr) -> None:
        """Note what is known of a name for an array, a row of one, or a struct."""
        array = value.value if isinstance(value, ast.Subscript) else value
        if isinstance(array, ast.Attribute) and self._struct_of(array.value) is not None and self._is_array(array):
            self._arrays.setdefault(name, self._field_array(array)[0])
        if _is_new_array(value):
            self._arrays[name] = REAL
        if isinstance(value, ast.Call) and isinstance(value.func, ast.Name):
            callee = self._outside.get(value.func.id)
            if isinstance(callee, type):
                self._text.setdefault(name, value.func.id)
                self._outside = {value.func.id: callee, **self._outside}
            elif callee is not None:
                text = str(plain(callee).__annotations__.get("return", ""))
                found = plain(callee).__globals__.get(text)
                if isinstance(found, type):
                    self._text.setdefault(name, text)
                    self._outside = {text: found, **self._outside}

    def _is_array(self, node: ast.Attribute) -> bool:
        return fields_of(self._struct_of(node.value)).get(node.attr) in ARRAYS

    # --- expressions

    def _as(self, kind: str, node: ast.expr) -> ast.expr:
        """Return an expression with the type of a kind."""
        if kind == REAL and self._kind(node) == INTEGER:
            if isinstance(node, ast.Constant):
                return _number(float(node.value))  # type: ignore[arg-type]
            return ast.Call(ast.Name("real", ast.Load()), [self._expression(node)], [])
        new = self._expression(node)
        literal = new.operand if isinstance(new, ast.UnaryOp) else new
        if kind == INTEGER and isinstance(literal, ast.Constant):
            return ast.Call(ast.Name("int", ast.Load()), [new], [])
        if kind == BOOLEAN and isinstance(new, ast.Constant):
            return ast.Call(ast.Name("bool", ast.Load()), [new], [])
        return new

    def _expression(self, node: ast.expr) -> ast.expr:
        if isinstance(node, ast.Constant):
            return _number(node.value) if isinstance(node.value, float) else node
        if isinstance(node, ast.Name):
            value = self._constant(node.id)
            return node if value is None else self._expression(ast.Constant(value))
        if isinstance(node, ast.BinOp):
            return self._binary(node)
        if isinstance(node, ast.UnaryOp):
            return ast.UnaryOp(node.op, self._expression(node.operand))
        if isinstance(node, ast.BoolOp):
            return ast.BoolOp(node.op, [self._expression(one) for one in node.values])
        if isinstance(node, ast.Compare):
            return self._comparison(node)
        if isinstance(node, ast.IfExp):
            kind = self._kind(node)
            return ast.IfExp(self._expression(node.test), self._as(kind, node.body), self._as(kind, node.orelse))
        if isinstance(node, ast.Call):
            return self._call(node)
        if isinstance(node, ast.Attribute):
            return self._attribute(node)
        if isinstance(node, ast.Subscript):
            entry = self._constant_entry(node)
            if entry is not None:
                return self._expression(ast.Constant(entry))
            return ast.Subscript(self._expression(node.value), self._expression(node.slice), node.ctx)
        if isinstance(node, ast.Tuple):
            return ast.Tuple([self._expression(one) for one in node.elts], node.ctx)
        raise TranslationError(f"'{ast.unparse(node)}' has no translation.")

    def _binary(self, node: ast.BinOp) -> ast.expr:
        kind = self._kind(node)
        left, right = self._as(kind, node.left), self._as(kind, node.right)
        if isinstance(node.op, ast.Pow):
            if isinstance(node.right, ast.Constant) and node.right.value == 2:
                return ast.BinOp(left, ast.Mult(), left)
            return _warp("pow", left, right)
        if kind == INTEGER and isinstance(node.op, ast.FloorDiv | ast.Mod | ast.Add | ast.Sub | ast.Mult):
            return ast.BinOp(self._expression(node.left), node.op, self._expression(node.right))
        return ast.BinOp(left, node.op, right)

    def _comparison(self, node: ast.Compare) -> ast.expr:
        pairs = list(zip([node.left, *node.comparators], node.ops, node.comparators, strict=False))
        parts: list[ast.expr] = []
        for left, operator, right in pairs:
            kind = REAL if REAL in (self._kind(left), self._kind(right)) else OTHER
            parts.append(ast.Compare(self._as(kind, left), [operator], [self._as(kind, right)]))
        return parts[0] if len(parts) == 1 else ast.BoolOp(ast.And(), parts)

    def _attribute(self, node: ast.Attribute) -> ast.expr:
        if isinstance(node.value, ast.Name) and node.value.id in ("math", "np"):
            return _number(getattr(math, node.attr))
        return ast.Attribute(self._expression(node.value), node.attr, node.ctx)

    def _call(self, node: ast.Call) -> ast.expr:
        if isinstance(node.func, ast.Attribute) and isinstance(node.func.value, ast.Name) and node.func.value.id == "math":
            return self._math(node.func.attr, [self._as(REAL, one) for one in node.args])
        if _is_new_array(node):
            shape = ast.keyword("shape", node.args[0])
            return ast.Call(ast.Attribute(ast.Name("wp", ast.Load()), "zeros", ast.Load()), [],
                            [shape, ast.keyword("dtype", ast.Name("real", ast.Load()))])  # fmt: skip
        assert isinstance(node.func, ast.Name)
        name = node.func.id
        if name in ("min", "max"):
            kind = self._kind(node)
            nested = self._as(kind, node.args[0])
            for one in node.args[1:]:
                nested = _warp(name, nested, self._as(kind, one))
            return nested
        if name in ("abs", "int", "float"):
            return _warp("abs", self._expression(node.args[0])) if name == "abs" else ast.Call(
                ast.Name("int" if name == "int" else "real", ast.Load()), [self._expression(one) for one in node.args], []
            )  # fmt: skip
        if name in SAME_IN_WARP:
            return ast.Call(node.func, [self._expression(one) for one in node.args], [])
        return self._call_of_ours(name, node.args)

    def _math(self, name: str, arguments: list[ast.expr]) -> ast.expr:
        if name in NATIVE:
            self.scope[name] = self._translation.native(name)
            return ast.Call(ast.Name(name, ast.Load()), arguments, [])
        if not hasattr(self._translation.warp, name):
            raise TranslationError(f"Warp has no function '{name}'.")
        return _warp(name, *arguments)

    def _call_of_ours(self, name: str, given: list[ast.expr]) -> ast.expr:
        """Call a function or make a struct of ours."""
        callee = self._outside.get(name)
        if callee is None:
            raise TranslationError(f"'{name}' has no translation.")
        if isinstance(callee, type):
            made = self._translation.struct(callee)
            kinds = [KIND_OF_ANNOTATION.get(text, OTHER) for text in fields_of(callee).values()]
            name = callee.__name__
        else:
            made, source = self._translation.function(callee), plain(callee)
            texts = [str(text) for key, text in source.__annotations__.items() if key != "return"]
            kinds = [KIND_OF_ANNOTATION.get(text, OTHER) if text not in ARRAYS else OTHER for text in texts]
            name = made.key
        self.scope[name] = made
        arguments = [
            self._vector(one) if isinstance(one, ast.Tuple) else self._as(kind, one)
            for one, kind in zip(given, kinds, strict=True)
        ]
        return ast.Call(ast.Name(name, ast.Load()), arguments, [])

    def _vector(self, node: ast.Tuple) -> ast.expr:
        """Return a tuple of numbers as a vector."""
        length = len(node.elts)
        name = f"vector_{length}"
        self.scope[name] = self._translation.warp.types.vector(length=length, dtype=self._translation.real)
        return ast.Call(ast.Name(name, ast.Load()), [self._as(REAL, one) for one in node.elts], [])


def _is_new_array(node: ast.expr) -> bool:
    """Whether an expression makes an array of zeros, which in a kernel belongs to one thread and has a constant shape."""
    return isinstance(node, ast.Call) and ast.unparse(node.func) == "np.zeros"


def _tuple_of_choices(value: ast.expr) -> ast.expr:
    """Return the choice between two tuples as a tuple of choices."""
    if not (isinstance(value, ast.IfExp) and isinstance(value.body, ast.Tuple) and isinstance(value.orelse, ast.Tuple)):
        return value
    pairs = zip(value.body.elts, value.orelse.elts, strict=True)
    return ast.Tuple([ast.IfExp(value.test, first, second) for first, second in pairs], ast.Load())


def _kinds_of_results(annotation: str, count: int) -> list[str]:
    """Return the kinds of the results of a function, given the annotation of what it returns."""
    words = annotation.removeprefix("tuple[").removesuffix("]").split(", ")
    return [KIND_OF_ANNOTATION.get(word, REAL) for word in words] if len(words) == count else [REAL] * count


class _WithConstant(ast.NodeTransformer):
    """Puts a number in the place of a name."""

    def __init__(self, name: str, value: float):
        self._name, self._value = name, value

    def visit_Name(self, node: ast.Name) -> ast.expr:  # noqa: N802
        """Return the number for the name."""
        return ast.Constant(self._value) if node.id == self._name else node


def _copy(node: ast.stmt) -> ast.stmt:
    return ast.parse(ast.unparse(node)).body[0]


def _loaded(node: ast.expr) -> ast.expr:
    """Return the target of an assignment as an expression."""
    found = ast.parse(ast.unparse(node), mode="eval").body
    assert isinstance(found, ast.expr)
    return found


def _name_of(node: ast.expr) -> str:
    while isinstance(node, ast.Subscript | ast.Attribute):
        node = node.value
    assert isinstance(node, ast.Name)
    return node.id


def _number(value: float) -> ast.expr:
    """Return a number of the translation's type."""
    text = ast.Constant(value) if math.isfinite(value) else ast.Attribute(ast.Name("wp", ast.Load()), "inf", ast.Load())
    return ast.Call(ast.Name("real", ast.Load()), [text], [])


def _warp(name: str, *arguments: ast.expr) -> ast.expr:
    return ast.Call(ast.Attribute(ast.Name("wp", ast.Load()), name, ast.Load()), list(arguments), [])
