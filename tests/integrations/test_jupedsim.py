"""What JuPedSim itself wrote is read as JuPedSim says it was, and gets bodies that go the same ways."""

from __future__ import annotations

import csv
import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from stridecast.cli.main import app
from stridecast.formats.recordings import load_motion
from stridecast.formats.store import save_database
from stridecast.formats.trajectories import load_trajectories

SCRIPT = """
import json, pathlib, sys
import jupedsim as jps
path, said = pathlib.Path(sys.argv[1]), []
simulation = jps.Simulation(
    model=jps.CollisionFreeSpeedModel(),
    geometry=[(0, 0), (9, 0), (9, 3), (12, 3), (12, 5), (7, 5), (7, 3), (0, 3)],
    dt=0.01,
    trajectory_writer=jps.SqliteTrajectoryWriter(output_file=path, every_nth_frame=5),
)
end = simulation.add_exit_stage([(11, 3), (12, 3), (12, 5), (11, 5)])
journey = simulation.add_journey(jps.JourneyDescription([end]))
for place in [(0.6, 0.7), (0.7, 2.2), (2.0, 1.5), (3.1, 0.6), (3.2, 2.4)]:
    simulation.add_agent(jps.CollisionFreeSpeedModelAgentParameters(
        journey_id=journey, stage_id=end, position=place, desired_speed=1.2, radius=0.2))
while simulation.agent_count() and simulation.elapsed_time() < 30:
    if simulation.iteration_count() % 5 == 0:
        said.append([[agent.id, *agent.position, *agent.orientation] for agent in simulation.agents()])
    simulation.iterate()
simulation._writer.close()
recording = jps.Recording(path)
again = [[[agent.id, *agent.position, *agent.orientation] for agent in recording.frame(k).agents]
         for k in range(recording.num_frames)]
json.dump({"simulated": said, "recorded": again, "rate": recording.fps}, open(sys.argv[2], "w"))
"""


@pytest.fixture(scope="module")
def simulated(jupedsim, tmp_path_factory):
    """A trajectory of five people round a corner, and what JuPedSim says of it: as it went, and read again."""
    folder = tmp_path_factory.mktemp("jupedsim")
    script, out = folder / "script.py", folder / "said.json"
    script.write_text(SCRIPT)
    command = [jupedsim, str(script), str(folder / "corner.sqlite"), str(out)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "corner.sqlite", json.loads(out.read_text())


def test_everybody_is_where_jupedsim_says(simulated):
    path, said = simulated
    ours = load_trajectories(path)
    assert said["rate"] == 20
    for which, exact in (("simulated", 1e-6), ("recorded", 1e-9)):
        frames = said[which]
        assert len(frames) > 100, which
        rows = np.array([[who, frame / 20, *rest] for frame, people in enumerate(frames) for who, *rest in people])
        rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
        np.testing.assert_array_equal(ours.ids, rows[:, 0], err_msg=which)
        np.testing.assert_allclose(ours.times, rows[:, 1], atol=1e-9)
        np.testing.assert_allclose(ours.positions, rows[:, 2:4] * [1, -1], atol=exact)
        assert not rows[:, 4:][rows[:, 1] == 0].any()
    assert ours.headings is None  # as JuPedSim tells no direction in the first frame


def test_they_get_bodies(simulated, formula_database, tmp_path: Path):
    path, _ = simulated
    save_database(formula_database, tmp_path / "database.safetensors")
    arguments = [path, "--database", tmp_path / "database.safetensors", "-o", tmp_path / "out.bvh", "--json"]
    result = CliRunner().invoke(app, ["dress", *map(str, arguments)])
    assert result.exit_code == 0, result.output
    told, source = json.loads(result.stdout), load_trajectories(path)
    assert told["people"] == 5
    assert told["mean_distance"] < 0.05
    with (tmp_path / "out.people.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [int(row["id"]) for row in rows] == source.people.tolist()
    for row in rows:
        motion, own = load_motion(tmp_path / row["file"]), source.rows(int(row["id"]))
        times = float(row["start"]) + np.arange(motion.frames) / motion.frame_rate
        assert abs(times[0] - source.times[own][0]) < 0.05
        assert abs(times[-1] - source.times[own][-1]) < 0.05
        pelvis = [np.interp(source.times[own], times, motion.root_positions[:, k]) for k in (0, 2)]
        away = np.linalg.norm(np.stack(pelvis, axis=-1) - source.positions[own], axis=-1)
        assert away.mean() < 0.1
        assert away.max() < 0.4
