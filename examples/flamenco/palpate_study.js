// SPDX-License-Identifier: GPL-3.0-or-later
//
// Job type of Flamenco for studies of Palpate: one task begins the study, many compute a part of its runs each, on any worker,
// and one makes the dataset and the report. Put this file into the folder `scripts` beside flamenco-manager. The study, its scene
// and the output folder have to lie on storage that all workers see under the same path.

const JOB_TYPE = {
    label: "Palpate Study",
    description: "Compute a scene many times with varied numbers (palpate sweep)",
    settings: [
        { key: "study", type: "string", subtype: "file_path", required: true, visible: "submission",
          eval: "str(abspath(bpy.path.abspath(C.scene.palpate.study.file)))",
          evalInfo: { showLinkButton: true, description: "File of the panel Study" },
          description: "File of the study (.toml), on storage that all workers see" },
        { key: "folder", type: "string", subtype: "dir_path", required: true, visible: "submission",
          eval: "str(abspath(bpy.path.abspath(C.scene.palpate.study.file)).with_suffix(''))",
          evalInfo: { showLinkButton: true, description: "Folder beside the file of the panel Study" },
          description: "Output folder, on storage that all workers see" },
        { key: "parts", type: "int32", default: 16, propargs: { min: 1, max: 10000 }, visible: "submission",
          description: "Number of tasks that share the runs" },
        { key: "command", type: "string", default: "palpate", visible: "submission",
          description: "Command palpate on the workers, of a Python with palpate[sweep]" },
        { key: "allow_scripts", type: "bool", default: false, visible: "submission",
          description: "Run the Python in the .blend, which can do everything that the worker can" },
        { key: "blendfile", type: "string", required: false, description: "The .blend of the submission", visible: "web" },
    ],
};

function compileJob(job) {
    const settings = job.settings;
    const parts = Math.max(1, Math.floor(settings.parts));
    const scripts = settings.allow_scripts ? ["--allow-scripts"] : [];

    const begin = sweepTask("begin", settings, [settings.study, "--out", settings.folder, "--begin", ...scripts]);
    job.addTask(begin);

    const finish = sweepTask("dataset and report", settings, [settings.folder, ...scripts]);
    for (let part = 1; part <= parts; part++) {
        const task = sweepTask(`runs ${part} of ${parts}`, settings,
            [settings.folder, "--part", `${part}/${parts}`, ...scripts]);
        task.addDependency(begin);
        finish.addDependency(task);
        job.addTask(task);
    }
    job.addTask(finish);
}

// A run that fails is written down and does not fail its task, so the task that makes the dataset always comes.
function sweepTask(name, settings, args) {
    const task = author.Task(name, "misc");
    task.addCommand(author.Command("exec", { exe: settings.command, args: ["sweep", ...args] }));
    return task;
}
