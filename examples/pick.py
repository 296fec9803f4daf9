# ---
# jupyter:
#   kernelspec: {display_name: Python 3, language: python, name: python3}
# ---

# %% [markdown]
# # From bags to a checked skill
#
# Six demonstrations of picking and placing become a skill that a robot can run: three commands, and what
# they made, in Python. The bags are simulated, as a lab would record them by guiding an arm (clone of the
# repository); with bags of your own, begin at `structlearn inspect`.

# %%
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from structlearn.feedback import Controller, read_skill
from structlearn.primitives import sequence
from structlearn.readers.demonstration import read_runs
from structlearn.reporting.movement_figures import shade_primitives, speed
from structlearn.segmentation.segments import read_segmentation

# %%
# !python -m dissertation.simulation.pick_and_place bags

# %% [markdown]
# `inspect` lists what is in the recordings and asks whether they are suitable; `new` makes a project from
# them, with an entry that it proposes.

# %%
# !structlearn inspect bags | sed -n '/^Suitable/,/^$/p'

# %%
# !structlearn new pick --from bags | tail -1

# %% [markdown]
# The entry can be edited. Here the movements get names, the path becomes relative to the project, and the
# arm is named so that the skill can be checked against its limits.

# %%
entries = Path("pick/structlearn.yaml")
text = entries.read_text().replace(str(Path("bags").resolve()), "../bags")
text = text.replace("primitives: 3", "primitives: [reach, carry, retreat]").rstrip()
entries.write_text(f"""{text}
    robot: {{urdf: franka_panda/panda.urdf, tip: panda_grasptarget,
      locked_joints: [panda_finger_joint1, panda_finger_joint2]}}
""")
print(entries.read_text())

# %% [markdown]
# `run` does the rest: it reads, cuts, learns, and checks. A second run does only
# what has changed. (Lines of DVC are left out here.)

# %%
# !cd pick && structlearn run 2>&1 | grep -v -e '^$' -e '^>' -e dvc -e git -e lock -e staging

# %% [markdown]
# ## The cuts
#
# Each demonstration is cut into the three movements; pauses between them belong to none.

# %%
task = Path("pick/data/tasks/pick")
runs = read_runs(task / "recorded/demonstrations.parquet")
cuts = read_segmentation(task / "segments").results
figure, panels = plt.subplots(2, 3, figsize=(9, 4), sharey=True, layout="constrained")
for run, panel in zip(runs, panels.flat, strict=True):
    panel.plot(run.time, speed(run), color="black", linewidth=1)
    shade_primitives(
        panel, [tuple(rows.loc[run.name, ["start_s", "end_s"]]) for rows in cuts.values()], list(cuts)
    )
    panel.set_xlabel(f"demonstration {run.name}: time (s)")
panels[0, 0].set_ylabel("speed (m/s)")
plt.show()

# %% [markdown]
# ## The skill
#
# One file holds all that a robot needs. The primitives start where the arm is and end at goals of your
# choice, here 5 cm to the left of the demonstrated ones and 3 cm above them: the shape is kept.

# %%
skill = read_skill(task / "skill/skill.safetensors")
nominal = sequence.unroll(skill.primitives, dt=0.01)
goals = sequence.moved_goals(sequence.default_goals(skill.primitives), [0.0, 0.05, 0.03])
moved = sequence.unroll(skill.primitives, dt=0.01, goals=goals)
figure, panel = plt.subplots(figsize=(8, 3.5), layout="constrained")
for run in runs:
    panel.plot(*run.position[:, 1:].T, color="lightgrey")
panel.plot(*nominal.position.position[:, 1:].T, label="demonstrated goals")
panel.plot(*moved.position.position[:, 1:].T, label="moved goals")
panel.set(xlabel="y (m)", ylabel="z (m)", aspect="equal")
figure.legend(loc="outside right upper")
plt.show()

# %% [markdown]
# ## Running it
#
# On the robot, a controller gives the next pose every millisecond. It needs neither torch nor this
# pipeline.

# %%
start = sequence.default_start(skill.primitives)
controller = Controller(skill, rate_hz=1000.0)
controller.start(start.position, start.orientation)
ticks = 0
while not controller.finished:
    controller.tick(None)  # this skill has no feedback: there is no reading to give
    ticks += 1
goal = skill.primitives[-1].position.goal
print(f"{ticks} ticks; {1e3 * np.linalg.norm(controller.position - goal):.2f} mm from the goal")

# %% [markdown]
# Can the arm follow? `check` tries the nominal run, and starts and goals in every corner of the workspace.

# %%
# !cd pick && structlearn check pick

# %% [markdown]
# The page with all this is `pick/reports/tasks/pick/index.html`, and `structlearn view pick` shows it in
# 3-D. Next: [your own data](../docs/own-data.md), [feedback from
# corrections](../docs/own-data.md#feedback), [on a robot](../docs/robot.md).
