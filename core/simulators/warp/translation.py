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
import copy
import inspect
import linecache
import math
import textwrap
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from types import GenericAlias, ModuleType
from typing import Any, TypeAlias

import numpy as np

from ...compiled.kernels import plain
from .block import IN_CUDA, THREADS

REAL, INTEGER, BOOLEAN, OTHER = "real", "integer", "boolean", "other"
"""Kinds of values, as far as the rewriting has to tell them apart."""
KIND_OF_ANNOTATION = {"float": REAL, "int": INTEGER, "bool": BOOLEAN}
ARRAYS = {"np.ndarray": REAL, "IntArray": INTEGER, "BoolArray": BOOLEAN}
"""Names of annotations of arrays, and the kind of what they hold."""
Typed: TypeAlias = tuple[str, ast.expr]
"""The kind of an expression of the source, and the expression rewritten."""
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
                self._functions[source] = self._compiled(source, name, self.warp.func)
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
            fields = {}
            for name, text in fields_of(kind).items():
                if text in ARRAYS:
                    values = getattr(example, name)
                    fields[name] = self.warp.array(dtype=self.type_of(values), ndim=values.ndim)
                else:
                    fields[name] = self.number_type(KIND_OF_ANNOTATION[text])
            made = type(kind.__name__, (), {"__annotations__": fields, "__module__": self.name})
            self.structs[kind] = self.warp.struct(made)
        return self.structs[kind]

    def value(self, example: Any, device: str) -> Any:
        """Return a named tuple of numbers and arrays as a value of its struct, with the arrays on a device."""
        made = self.struct(type(example), example)()
        for name, value in example._asdict().items():
            setattr(made, name, self.array(value, device) if isinstance(value, np.ndarray) else value)
        return made

    def room(self, example: Any, count: int, device: str) -> Any:
        """Return the arrays of many environments as a value of their struct, given those of one, each full of one number."""
        made = self.struct(type(example), example)()
        for name, values in example._asdict().items():
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

    def _compiled(self, source: Callable[..., Any], name: str, decorate: Callable[[Any], Any], threads: int = 0) -> Any:
        """Return a function, decorated; its first arguments, so many, are the index of a thread."""
        rewriter = _Rewriter(self, source)
        body, annotations = rewriter.body(), rewriter.annotations()
        arguments = list(annotations)
        if threads:
            body = [*ast.parse(f"{', '.join(arguments[:threads])} = wp.tid()").body, *body]
        header = ast.parse(f"def {name}({', '.join(arguments[threads:])}): pass").body[0]
        assert isinstance(header, ast.FunctionDef)
        header.body = body
        made = self._executed(ast.unparse(ast.fix_missing_locations(header)) + "\n", name, rewriter.scope)
        made.__annotations__ = {argument: annotations[argument] for argument in arguments[threads:]}
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
    source : callable

    Attributes
    ----------
    scope : dict
        Functions and types by the names that the rewritten function has for them.
    """

    def __init__(self, translation: Translation, source: Callable[..., Any]):
        self._translation, self._outside = translation, {**source.__globals__, **translation.instead}
        tree = _Unrolled(self._outside).visit(ast.parse(textwrap.dedent(inspect.getsource(source))).body[0])
        assert isinstance(tree, ast.FunctionDef)
        self._tree = tree
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

        def expect(name: str, count: int) -> None:
            axes[name] = max(axes.get(name, 0), count)

        for node in ast.walk(self._tree):
            match node:
                case ast.Subscript(ast.Name(name), ast.Constant(int(index))) if self._text.get(name, "").startswith("tuple"):
                    expect(name, index + 1)
                case ast.Subscript(ast.Name(name)):
                    expect(name, _indices(node))
                case ast.Call(ast.Name(name)):
                    callee = self._outside.get(name)
                    if not callable(callee) or isinstance(callee, type) or name in SAME_IN_WARP:
                        continue
                    inner = _Rewriter(self._translation, plain(callee))  # whose arguments have these axes here, too
                    for given, argument in zip(node.args, inner._tree.args.args, strict=False):
                        found = inner._axes.get(argument.arg, 0)
                        if isinstance(given, ast.Name):
                            expect(given.id, found)
                        elif isinstance(given, ast.Subscript) and isinstance(given.value, ast.Name) and found:
                            expect(given.value.id, found + _indices(given))
        return axes

    def _constant(self, name: str) -> Any:
        """Return a number, or a tuple of them, that a name stands for outside the function, or None."""
        value = None if name in self._kinds else self._outside.get(name)
        return value if isinstance(value, bool | int | float | tuple) else None

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

    def _field_text(self, node: ast.Attribute) -> str:
        """Return the annotation of a struct's field; of anything else that of a number."""
        kind = self._struct_of(node.value)
        return "float" if kind is None else fields_of(kind).get(node.attr, "float")

    # --- statements

    def _block(self, body: list[ast.stmt]) -> list[ast.stmt]:
        return [new for statement in body for new in self._statement(statement)]

    def _statement(self, node: ast.stmt) -> list[ast.stmt]:
        match node:
            case ast.Expr(ast.Constant()):
                return []
            case ast.Expr(value):
                return [ast.Expr(self._expression(value))]
            case ast.Assign(targets, value):
                return [new for target in targets for new in self._assign(target, value)]
            case ast.AugAssign(target, operator, value):
                return self._assign(target, ast.BinOp(target, operator, value))
            case ast.Return(value):
                return [ast.Return(None if value is None else self._returned(value))]
            case ast.If():
                return self._branch(node)
            case ast.While(test, body):
                return [ast.While(self._expression(test), self._block(body), [])]
            case ast.For(ast.Name(name) as target, values, body):
                self._kinds[name] = INTEGER
                return [ast.For(target, self._expression(values), self._block(body), [])]
            case ast.Break() | ast.Continue() | ast.Pass():
                return [node]
        raise TranslationError(f"'{ast.unparse(node)}' has no translation.")

    def _branch(self, node: ast.If) -> list[ast.stmt]:
        """Return a branch; numbers that it introduces exist before it, since Warp joins only such after a branch."""
        before, test = set(self._kinds), self._expression(node.test)
        new = ast.If(test, self._block(node.body), self._block(node.orelse))
        zeros = {REAL: _number(0.0), INTEGER: _called("int", ast.Constant(0)), BOOLEAN: _called("bool", ast.Constant(False))}
        fresh = {name: kind for name, kind in self._kinds.items() if name not in before and kind in zeros}
        return [*(ast.Assign([ast.Name(name)], zeros[kind]) for name, kind in fresh.items()), new]

    def _returned(self, value: ast.expr) -> ast.expr:
        value, wanted = _tuple_of_choices(value), ast.unparse(self._tree.returns) if self._tree.returns else ""
        if isinstance(value, ast.Tuple):
            kinds = _kinds_of_results(wanted, len(value.elts))
            return ast.Tuple([self._as(kind, one) for kind, one in zip(kinds, value.elts, strict=True)])
        return self._as(KIND_OF_ANNOTATION.get(wanted, OTHER), value)

    def _assign(self, target: ast.expr, value: ast.expr) -> list[ast.stmt]:
        if not isinstance(target, ast.Tuple):
            return [self._assign_one(target, value)]
        value = _tuple_of_choices(value)
        if isinstance(value, ast.Call):
            return self._assign_call(target, value)
        parts = value.elts if isinstance(value, ast.Tuple) else self._parts(value, len(target.elts))
        written = {_name_of(one) for one in target.elts if not isinstance(one, ast.Tuple)}
        before: list[ast.stmt] = []
        if isinstance(value, ast.Tuple) and written & _names_in(value):  # all values are those before the first assignment
            temporaries: list[ast.expr] = [ast.Name(self._temporary()) for _ in parts]
            before = [new for one, part in zip(temporaries, parts, strict=True) for new in self._assign(one, part)]
            parts = temporaries
        return before + [new for one, part in zip(target.elts, parts, strict=True) for new in self._assign(one, part)]

    def _parts(self, value: ast.expr, count: int) -> list[ast.expr]:
        """Return the entries of a tuple that has a name."""
        kind = self._struct_of(value)
        if kind is not None:
            return [ast.Attribute(value, field) for field in kind._fields]
        return [ast.Subscript(value, ast.Constant(i)) for i in range(count)]

    def _assign_call(self, target: ast.Tuple, value: ast.Call) -> list[ast.stmt]:
        """Assign the results of a function to names, and from there to entries of arrays."""
        callee = self._outside.get(value.func.id) if isinstance(value.func, ast.Name) else None
        annotation = "" if callee is None else _returns(callee)
        names: list[ast.expr] = []
        after: list[ast.stmt] = []
        for one, kind in zip(target.elts, _kinds_of_results(annotation, len(target.elts)), strict=True):
            name = one.id if isinstance(one, ast.Name) and one.id != "_" else self._temporary()
            self._kinds[name] = kind
            names.append(ast.Name(name))
            if not isinstance(one, ast.Name):
                after.append(self._assign_one(one, ast.Name(name)))
        return [ast.Assign([ast.Tuple(names)], self._expression(value)), *after]

    def _temporary(self) -> str:
        self._temporaries += 1
        return f"t_{self._temporaries}"

    def _assign_one(self, target: ast.expr, value: ast.expr) -> ast.stmt:
        if isinstance(target, ast.Name):
            self._note(target.id, value)
            typed = self._typed(value)
            if self._kinds.get(target.id, OTHER) == OTHER:
                self._kinds[target.id] = typed[0]
            return ast.Assign([target], _cast(self._kinds[target.id], typed))
        kind, place = self._typed(target)
        return ast.Assign([place], self._as(kind, value))

    def _note(self, name: str, value: ast.expr) -> None:
        """Note what is known of a name for an array, a row of one, or a struct."""
        array = value.value if isinstance(value, ast.Subscript) else value
        if isinstance(array, ast.Attribute) and self._field_text(array) in ARRAYS:
            self._arrays.setdefault(name, self._field_array(array)[0])
        if _is_new_array(value):
            self._arrays[name] = REAL
        if isinstance(value, ast.Call) and isinstance(value.func, ast.Name):
            text, found = value.func.id, self._outside.get(value.func.id)
            if found is not None and not isinstance(found, type):
                text = _returns(found)
                found = plain(found).__globals__.get(text)
            if isinstance(found, type):
                self._text.setdefault(name, text)
                self._outside.setdefault(text, found)

    # --- expressions

    def _as(self, kind: str, node: ast.expr) -> ast.expr:
        """Return an expression with the type of a kind."""
        return _cast(kind, self._typed(node))

    def _expression(self, node: ast.expr) -> ast.expr:
        return self._typed(node)[1]

    def _typed(self, node: ast.expr) -> Typed:
        """Return the kind of an expression of the source, and the expression rewritten."""
        match node:
            case ast.Constant(bool()):
                return BOOLEAN, node
            case ast.Constant(int()):
                return INTEGER, node
            case ast.Constant(float(number)):
                return REAL, _number(number)
            case ast.Name(name):
                value = self._constant(name)
                known = value is not None and not isinstance(value, tuple)
                return self._typed(ast.Constant(value)) if known else (self._kinds.get(name, OTHER), node)
            case ast.UnaryOp(operator, operand):
                kind, new = self._typed(operand)
                return BOOLEAN if isinstance(operator, ast.Not) else kind, ast.UnaryOp(operator, new)
            case ast.BoolOp(operator, values):
                return BOOLEAN, ast.BoolOp(operator, [self._expression(one) for one in values])
            case ast.BinOp():
                return self._binary(node)
            case ast.Compare():
                return BOOLEAN, self._comparison(node)
            case ast.IfExp(test, body, orelse):
                kind, (first, second) = self._alike([body, orelse])
                return kind, ast.IfExp(self._expression(test), first, second)
            case ast.Call():
                return self._call(node)
            case ast.Attribute(ast.Name("math" | "np"), name):
                return REAL, _number(getattr(math, name))
            case ast.Attribute(value, name):
                return KIND_OF_ANNOTATION.get(self._field_text(node), OTHER), ast.Attribute(self._expression(value), name)
            case ast.Subscript():
                return self._entry(node)
            case ast.Tuple(parts):
                return OTHER, ast.Tuple([self._expression(one) for one in parts])
        raise TranslationError(f"'{ast.unparse(node)}' has no translation.")

    def _alike(self, nodes: Sequence[ast.expr]) -> tuple[str, list[ast.expr]]:
        """Return the kind that several expressions have in common, else real numbers, and these with its type."""
        typed = [self._typed(one) for one in nodes]
        kinds = {kind for kind, _ in typed}
        kind = kinds.pop() if len(kinds) == 1 else REAL
        return kind, [_cast(kind, one) for one in typed]

    def _entry(self, node: ast.Subscript) -> Typed:
        """Return an entry of an array or tuple; a row of an array is of no kind of number."""
        match node:
            case ast.Subscript(ast.Name(name), ast.Constant(int(index))) if isinstance(self._constant(name), tuple):
                return self._typed(ast.Constant(self._constant(name)[index]))
            case ast.Subscript(ast.Attribute() as value):
                kind, axes = self._field_array(value)
            case ast.Subscript(ast.Name(name)) if not self._text.get(name, "").startswith("tuple"):
                kind, axes = self._arrays.get(name, REAL), self._axes.get(name, 1)
            case _:
                kind, axes = REAL, 0
        new = ast.Subscript(self._expression(node.value), self._expression(node.slice))
        return kind if _indices(node) >= axes else OTHER, new

    def _binary(self, node: ast.BinOp) -> Typed:
        left, right = self._typed(node.left), self._typed(node.right)
        kind = INTEGER if left[0] == right[0] == INTEGER and not isinstance(node.op, ast.Div) else REAL
        if kind == INTEGER and not isinstance(node.op, ast.Pow):
            return kind, ast.BinOp(left[1], node.op, right[1])
        first, second = _cast(kind, left), _cast(kind, right)
        if not isinstance(node.op, ast.Pow):
            return kind, ast.BinOp(first, node.op, second)
        is_square = isinstance(node.right, ast.Constant) and node.right.value == 2
        return kind, ast.BinOp(first, ast.Mult(), first) if is_square else _called("wp.pow", first, second)

    def _comparison(self, node: ast.Compare) -> ast.expr:
        sides = [self._typed(one) for one in (node.left, *node.comparators)]
        parts: list[ast.expr] = []
        for left, operator, right in zip(sides, node.ops, sides[1:], strict=False):
            kind = REAL if REAL in (left[0], right[0]) else OTHER
            parts.append(ast.Compare(_cast(kind, left), [operator], [_cast(kind, right)]))
        return parts[0] if len(parts) == 1 else ast.BoolOp(ast.And(), parts)

    def _call(self, node: ast.Call) -> Typed:
        match node.func:
            case ast.Attribute(ast.Name("math"), name):
                arguments = [self._as(REAL, one) for one in node.args]
                if name in NATIVE:
                    self.scope[name] = self._translation.native(name)
                elif not hasattr(self._translation.warp, name):
                    raise TranslationError(f"Warp has no function '{name}'.")
                return REAL, _called(name if name in NATIVE else f"wp.{name}", *arguments)
            case ast.Attribute(ast.Name("np"), "zeros"):
                made = _called("wp.zeros")
                made.keywords = [ast.keyword("shape", node.args[0]), ast.keyword("dtype", ast.Name("real"))]
                return OTHER, made
            case ast.Name("min" | "max" | "abs" as name):
                kind, values = self._alike(node.args)
                if name == "abs":
                    return kind, _called("wp.abs", self._expression(node.args[0]))
                return kind, reduce(lambda nested, one: _called(f"wp.{name}", nested, one), values)
            case ast.Name("int" | "len" | "float" | "range" as name):
                called = _called("real" if name == "float" else name, *map(self._expression, node.args))
                return INTEGER if name in ("int", "len") else OTHER, called
            case ast.Name(name):
                return self._call_of_ours(name, node.args)
        raise TranslationError(f"'{ast.unparse(node)}' has no translation.")

    def _call_of_ours(self, name: str, given: list[ast.expr]) -> Typed:
        """Call a function or make a struct of ours."""
        callee = self._outside.get(name)
        if callee is None:
            raise TranslationError(f"'{name}' has no translation.")
        if isinstance(callee, type):
            made, name, kind = self._translation.struct(callee), callee.__name__, OTHER
            texts = list(fields_of(callee).values())
        else:
            made = self._translation.function(callee)
            name, kind = made.key, KIND_OF_ANNOTATION.get(_returns(callee), OTHER)
            texts = [str(text) for key, text in plain(callee).__annotations__.items() if key != "return"]
        self.scope[name] = made
        kinds = [KIND_OF_ANNOTATION.get(text, OTHER) for text in texts]
        arguments = [
            self._vector(one) if isinstance(one, ast.Tuple) else self._as(wanted, one)
            for one, wanted in zip(given, kinds, strict=True)
        ]
        return kind, _called(name, *arguments)

    def _vector(self, node: ast.Tuple) -> ast.expr:
        """Return a tuple of numbers as a vector."""
        length = len(node.elts)
        name = f"vector_{length}"
        self.scope[name] = self._translation.warp.types.vector(length=length, dtype=self._translation.real)
        return _called(name, *(self._as(REAL, one) for one in node.elts))


def _cast(kind: str, typed: Typed) -> ast.expr:
    """Return an expression with the type of a kind."""
    found, new = typed
    literal = new.operand if isinstance(new, ast.UnaryOp) else new
    if kind == REAL and found == INTEGER:
        return _number(float(new.value)) if isinstance(new, ast.Constant) else _called("real", new)  # type: ignore[arg-type]
    if kind == INTEGER and isinstance(literal, ast.Constant):
        return _called("int", new)
    return _called("bool", new) if kind == BOOLEAN and isinstance(new, ast.Constant) else new


class _Unrolled(ast.NodeTransformer):
    """Repeats the body of each loop over a tuple that stands outside the function, with its entries in the place of names.

    Entries are numbers, functions, or tuples of these, which the loop takes apart.
    """

    def __init__(self, outside: dict[str, Any]):
        self._outside, self._entries = outside, dict[str, ast.expr]()

    def visit_Name(self, node: ast.Name) -> ast.expr:  # noqa: N802
        """Return the entry for the name."""
        return self._entries.get(node.id, node)

    def visit_For(self, node: ast.For) -> Any:  # noqa: N802
        """Return the bodies for all entries."""
        values = self._outside.get(node.iter.id) if isinstance(node.iter, ast.Name) else None
        if not isinstance(values, tuple):
            return self.generic_visit(node)
        bodies: list[ast.stmt] = []
        before = dict(self._entries)
        for value in values:
            names, entries = (node.target.elts, value) if isinstance(node.target, ast.Tuple) else ([node.target], [value])
            for name, entry in zip(names, entries, strict=True):
                known: ast.expr = ast.Constant(entry)
                if callable(entry):
                    known = ast.Name(f"function_{len(self._outside)}")
                    self._outside[known.id] = entry
                self._entries[_name_of(name)] = known
            one = copy.deepcopy(node)
            one.target = ast.Name("_")
            bodies += self.generic_visit(one).body  # type: ignore[attr-defined]
        self._entries = before  # behind the loop the names are variables again
        return bodies


def _indices(node: ast.Subscript) -> int:
    """Return how many indices an array is given."""
    return len(node.slice.elts) if isinstance(node.slice, ast.Tuple) else 1


def _returns(function: Callable[..., Any]) -> str:
    """Return the annotation of what a function returns."""
    return str(plain(function).__annotations__.get("return", ""))


def _is_new_array(node: ast.expr) -> bool:
    """Whether an expression makes an array of zeros, which in a kernel belongs to one thread and has a constant shape."""
    return isinstance(node, ast.Call) and ast.unparse(node.func) == "np.zeros"


def _tuple_of_choices(value: ast.expr) -> ast.expr:
    """Return the choice between two tuples as a tuple of choices."""
    if not (isinstance(value, ast.IfExp) and isinstance(value.body, ast.Tuple) and isinstance(value.orelse, ast.Tuple)):
        return value
    pairs = zip(value.body.elts, value.orelse.elts, strict=True)
    return ast.Tuple([ast.IfExp(value.test, first, second) for first, second in pairs])


def _kinds_of_results(annotation: str, count: int) -> list[str]:
    """Return the kinds of the results of a function, given the annotation of what it returns."""
    words = annotation.removeprefix("tuple[").removesuffix("]").split(", ")
    return [KIND_OF_ANNOTATION.get(word, REAL) for word in words] if len(words) == count else [REAL] * count


def _names_in(node: ast.expr) -> set[str]:
    return {one.id for one in ast.walk(node) if isinstance(one, ast.Name)}


def _name_of(node: ast.expr) -> str:
    while isinstance(node, ast.Subscript | ast.Attribute):
        node = node.value
    assert isinstance(node, ast.Name)
    return node.id


def _number(value: float) -> ast.expr:
    """Return a number of the translation's type."""
    return _called("real", ast.Constant(value)) if math.isfinite(value) else ast.parse("real(wp.inf)", mode="eval").body


def _called(name: str, *arguments: ast.expr) -> ast.Call:
    """Return a call of a function of Warp or of the scope."""
    scope, _, own = name.rpartition(".")
    return ast.Call(ast.Attribute(ast.Name(scope), own) if scope else ast.Name(own), list(arguments), [])
