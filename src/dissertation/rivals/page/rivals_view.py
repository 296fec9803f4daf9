"""Recording of all methods side by side, on the same board at the same tilt."""

from collections.abc import Sequence

from dissertation.rivals.imitation_data import Recorded
from dissertation.rivals.page.findings import LOOKS
from dissertation.rivals.protocol import MethodParameters, trained
from dissertation.rivals.situations import UNMOVED
from dissertation.scraping.protocol.execution_scores import orientation_cost, traces
from dissertation.scraping.protocol.executions import Bench, evaluation_runs
from dissertation.scraping.recordings.scraping_scene import (
    Execution,
    close_view,
    full_scale,
    scene,
    signal_plots,
)
from structlearn.viewer import views
from structlearn.viewer.items import entity
from structlearn.viewer.recording import Recording

NOTE = """One person's demonstrations, learned by each method and executed at {:g} degrees, which nobody
demonstrated. Colours of the electrodes: readings relative to the expected ones."""


def executed_once(
    bench: Bench, recorded: Recorded, methods: MethodParameters, tilt: float, seed: int
) -> list[Execution]:
    """One execution of each method with all demonstrations, at a tilt in degrees. `seed`: of training."""
    (run,), names = evaluation_runs([tilt], 1, feedback=True), [one.name for one in bench.skill.primitives]
    supervision, shown = bench.supervision, []
    for model, look in LOOKS.items():
        execute = trained(bench, recorded, getattr(methods, model, None), seed)
        done, skill = execute(run, situation=UNMOVED), execute.keywords.get("skill", bench.skill)
        networks = {name: its[supervision.axis] for name, its in skill.networks.items()}
        felt = traces(model, {tilt: [done]}, names, networks, bench.skill.expected, supervision)
        shown.append(Execution(look, done, tilt, names, felt, orientation_cost(done, bench.nominal)))
    return shown


def side_by_side(executions: Sequence[Execution]) -> Recording:
    """Scenes beside each other, and the signals of all."""
    runs, scale = [one.run for one in executions], full_scale(executions)
    scenes = [
        close_view(one.look.name, scene(entity("runs", one.look.name), one, scale)) for one in executions
    ]
    colours = views.legend(dict(one.look for one in executions))
    text = NOTE.format(executions[0].board_deg)
    note = views.notes(f"{text}\n\n{colours}\n\n**{views.origin_sentence(runs)}**")
    plots = views.column(*signal_plots("signals", executions))
    left = views.column(views.grid(*scenes), note, shares=[4, 1])
    return Recording("Scraping: with and without structure", views.row(left, plots, shares=[3, 2]))
