# SPDX-License-Identifier: GPL-3.0-or-later
"""The job type for Flamenco gives tasks whose commands Palpate understands. Flamenco itself is played by a few lines."""

import json
import shutil
import subprocess

import pytest

from palpate.commands import sweep

PLAYED = """
const fs = require("fs"), vm = require("vm");
class Task { constructor(name, type) { Object.assign(this, {name, type, commands: [], needs: []}); }
  addCommand(command) { this.commands.push(command); }
  addDependency(task) { this.needs.push(task.name); } }
const author = { Task: (name, type) => new Task(name, type), Command: (name, parameters) => ({name, parameters}) };
const jobs = [], job = { settings: JSON.parse(process.argv[2]), addTask: (task) => jobs.push(task) };
const scope = vm.createContext({ author, job, print: () => {} });
vm.runInContext(fs.readFileSync(process.argv[1], "utf-8") + "; compileJob(job); result = JSON.stringify(JOB_TYPE);", scope);
process.stdout.write(JSON.stringify({ type: JSON.parse(scope.result), jobs }));
"""
TYPES = {"string": str, "int32": int, "bool": bool}


@pytest.fixture(scope="module")
def compiled(repository):
    node = shutil.which("node")
    if node is None:
        pytest.skip("Node.js is not installed: the job type for Flamenco is not compiled")
    settings = {"study": "/s/study.toml", "folder": "/s/out", "parts": 3, "command": "palpate", "allow_scripts": False}
    script = repository / "examples" / "flamenco" / "palpate_study.js"
    done = subprocess.run([node, "-e", PLAYED, str(script), json.dumps(settings)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_settings_are_of_the_kinds_that_flamenco_knows(compiled):
    assert compiled["type"]["label"] == "Palpate Study"
    for setting in compiled["type"]["settings"]:
        assert set(setting) <= {
            *("key", "type", "subtype", "required", "default", "eval", "evalInfo", "description", "propargs", "visible"),
        }
        assert "default" not in setting or isinstance(setting["default"], TYPES[setting["type"]])
        assert setting.get("subtype", "file_path") in {"file_path", "dir_path", "file_name", "hashed_file_path"}
        assert setting["visible"] in {"visible", "hidden", "submission", "web"}
        compile(setting.get("eval", "0"), setting["key"], "eval")


def test_tasks_begin_compute_and_finish(compiled):
    import argparse

    parser = argparse.ArgumentParser()
    sweep.add_arguments(parser)
    tasks = {task["name"]: task for task in compiled["jobs"]}
    names = ["begin", "runs 1 of 3", "runs 2 of 3", "runs 3 of 3", "dataset and report"]
    assert list(tasks) == names
    for name in names[1:4]:
        assert tasks[name]["needs"] == ["begin"]
    assert tasks["dataset and report"]["needs"] == names[1:4]
    for task in compiled["jobs"]:
        (command,) = task["commands"]
        assert (command["name"], command["parameters"]["exe"], command["parameters"]["args"][0]) == ("exec", "palpate", "sweep")
        parsed = parser.parse_args(command["parameters"]["args"][1:])
        assert parsed.begin == (task["name"] == "begin")
        assert (parsed.part is None) == ("runs" not in task["name"])
