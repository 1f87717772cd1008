"""JuPedSim lets people leave a room; they get full bodies: its trajectories, a BVH each, and a picture of a moment.

pip install jupedsim
python examples/dress_jupedsim.py
"""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import stridecast as sc
from stridecast.body import kinematics
from stridecast.cli.screen import progress
from stridecast.crowd.dressing import Dressed
from stridecast.formats.picture import Camera, draw_body, plotting

OUT = Path("jupedsim")

# A plan in metres, y up the page: a room of 8 x 6 m with a door of 1 m in its right wall, and what is behind it.
ROOM = [
    (0, 0),
    (8, 0),
    (8, 2.5),
    (8.2, 2.5),
    (8.2, 0),
    (16, 0),
    (16, 6),
    (8.2, 6),
    (8.2, 3.5),
    (8, 3.5),
    (8, 6),
    (0, 6),
]
EXIT = [(15, 0), (16, 0), (16, 6), (15, 6)]
PEOPLE = 24


def main() -> None:
    if find_spec("jupedsim") is None:
        print("JuPedSim is not installed, so there is nothing to dress: pip install jupedsim")
        return
    OUT.mkdir(exist_ok=True)
    source = OUT / "room.sqlite"
    simulate(source)
    trajectories = sc.load_trajectories(source)
    with progress(False, {"make": "making sample takes", "analyse": "analysing takes", "assemble": "learning"}) as tell:
        database = sc.sample_database(progress=tell)
    with progress(False, {"dress": "dressing"}) as tell:
        dressed = sc.dress(database, trajectories, progress=lambda done, total: tell("dress", done, total))
    for one in dressed.people:
        assert one.motion is not None
        sc.write_bvh(OUT / f"room.{one.person}.bvh", one.motion)
    print(f"wrote {source} and {len(dressed.people)} BVH beside it; times begin at {dressed.people[0].start:g} s")
    print(f"{100 * dressed.mean_distance:.1f} cm from what JuPedSim says, on average")
    beyond = ", ".join(f"{name} {count}" for name, count in dressed.beyond.items() if count)
    print(f"samples of {len(trajectories)} that no person could have walked: {beyond or 'none'}")
    if find_spec("matplotlib") is not None:
        draw(OUT / "room.png", dressed, trajectories, 6.0)
        print(f"wrote {OUT / 'room.png'} (after 6 s; what JuPedSim says in red, what is shown in black)")


def simulate(path: Path) -> None:
    """Let people leave the room."""
    import jupedsim as jps

    simulation = jps.Simulation(
        model=jps.CollisionFreeSpeedModel(),
        geometry=ROOM,
        dt=0.01,
        trajectory_writer=jps.SqliteTrajectoryWriter(output_file=path, every_nth_frame=10),
    )
    door = simulation.add_waypoint_stage((8.6, 3.0), 0.5)
    end = simulation.add_exit_stage(EXIT)
    journey = jps.JourneyDescription([door, end])
    journey.set_transition_for_stage(door, jps.Transition.create_fixed_transition(end))
    number = simulation.add_journey(journey)
    for place in jps.distribute_by_number(
        polygon=polygon_of(ROOM[:3] + ROOM[9:]),
        number_of_agents=PEOPLE,
        distance_to_agents=0.7,
        distance_to_polygon=0.4,
        seed=1,
    ):
        simulation.add_agent(
            jps.CollisionFreeSpeedModelAgentParameters(
                journey_id=number, stage_id=door, position=place, desired_speed=1.3, radius=0.2
            )
        )
    while simulation.agent_count() > 0 and simulation.elapsed_time() < 60:
        simulation.iterate()


def polygon_of(corners: list[tuple[float, float]]) -> object:
    import shapely

    return shapely.Polygon(corners)


def draw(path: Path, dressed: Dressed, trajectories: sc.Trajectories, moment: float) -> None:
    """Draw everybody at a moment, and the ways of all."""
    camera = Camera(np.array([8.0, 0.5, -3.0]), 20.0, np.radians(15), np.radians(35))
    figure = plotting().Figure(figsize=(13, 6.2), dpi=100, layout="constrained")
    axes = figure.subplots()

    def line(points: np.ndarray, colour: str, width: float) -> None:
        seen, _ = camera.see(np.stack((points[:, 0], np.zeros(len(points)), points[:, 1]), axis=-1))
        axes.plot(*seen.T, color=colour, linewidth=width, zorder=1)

    line(np.array([*ROOM, ROOM[0]]) * (1, -1), "#a0aec0", 3.0)
    for _, rows in trajectories.each():
        line(trajectories.positions[rows], "#d62728", 0.5)
    here = []
    for one in dressed.people:
        line(one.vehicle.position, "black", 0.7)
        frame = round((moment - one.start) * dressed.frame_rate)
        if one.motion is not None and 0 <= frame < one.frames:
            motion = one.motion.clip(frame, frame + 1)
            world = kinematics.pose(motion)
            here.append((motion.skeleton, world.positions[0], kinematics.ends(motion.skeleton, world)[0]))
    far = [float(np.linalg.norm(positions[0] - camera.place)) for _, positions, _ in here]
    for order, k in enumerate(np.argsort(far)[::-1].tolist()):
        draw_body(axes, camera, *here[k], 10 + order)
    axes.set_aspect("equal")
    axes.axis("off")
    figure.savefig(path)


if __name__ == "__main__":
    sys.exit(main())
