"""Crowds in the situations of the literature: ours and those of other people's simulators, by the same measures.

    python bench/crowd.py [--situations head_on,crossing] [--seeds 2] [--database DB] [--json OUT.json] [--pictures DIR]

Everybody gets the same people, starts, stops, speeds and widths, is sampled at the same rate, and is held to the
human bounds that the database has learned. Peers that are not installed (python bench/peers.py) are left out. What
one of them takes is the time of its own loop, without starting Python.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import shapely

import peers
import stridecast as sc
from stridecast.crowd.bounds import HumanBounds
from stridecast.crowd.crowd import Crowd
from stridecast.crowd.population import Population, task_of
from stridecast.model.scene import Circle, Scene
from stridecast.model.trajectories import Trajectories
from stridecast.paths.generate import generate_path
from stridecast.samples.situations import SITUATIONS, situation
from stridecast.scorecard.crowds import CrowdScore, score_crowd
from stridecast.scorecard.travel import REACH

RATE = 30.0
"""At which all are sampled, Hz."""

LONGEST = 120.0
"""A scene that says nothing else lasts so long, seconds."""

RESOLUTION = 1e-5
"""RVO2 computes in single precision: its places are as if rounded to so many metres."""

Plain = dict[str, Any]
Runner = Callable[[Scene, int], peers.Simulated]


def plain(scene: Scene, seed: int) -> Plain:
    """A scene as plain numbers, everybody who is there at the beginning with the points they go to."""
    people = [p for due in Population(scene, seed=seed, frame_rate=RATE).until(0.0) for p in due.people]
    return {
        "people": [
            {
                "start": p.start.tolist(),
                "stops": [stop[0].tolist() for stop in p.stops],
                "speed": p.behavior.velocity,
                "radius": p.behavior.body_radius,
                "way": way(scene, p),
            }
            for p in people
        ],
        "walls": [wall.points.tolist() for wall in scene.walls],
        "circles": [[*o.center.tolist(), o.radius] for o in scene.obstacles if isinstance(o, Circle)],
        "polygons": [o.points.tolist() for o in scene.obstacles if not isinstance(o, Circle)],
        "seconds": scene.seconds or LONGEST,
    }


def way(scene: Scene, person: Any) -> float | None:
    """Length of the planned way of somebody alone who cannot go straight, metres; nothing for all others."""
    walls = [shapely.LineString(wall.points) for wall in scene.walls]
    solid = shapely.union_all([*walls, *(shapely.Polygon(o.points) for o in scene.obstacles if hasattr(o, "points"))])
    straight = shapely.LineString(np.concatenate((person.start[None], *person.stops)))
    return generate_path(task_of(scene, person)).curve.length - REACH if straight.intersects(solid) else None


def peer(name: str, scene: Scene, seed: int) -> peers.Simulated:
    """How a peer walks a scene."""
    return peers.simulate(name, plain(scene, seed), RATE)


def ours(database: sc.MotionDatabase, scene: Scene, seed: int) -> peers.Simulated:
    """How our crowd walks a scene: vehicles without bodies, as the peers'."""
    crowd = Crowd(database, scene, seed=seed, bodies=False, frame_rate=RATE)
    frames = [crowd.frame()]
    begun = time.perf_counter()
    while not crowd.done and crowd.time < (scene.seconds or LONGEST):
        frames.append(crowd.step())
    seconds = time.perf_counter() - begun
    ids = np.concatenate([frame.ids for frame in frames])
    times = np.concatenate([np.full(len(frame.ids), frame.time) for frame in frames])
    positions = np.concatenate([frame.positions for frame in frames])
    order = np.lexsort((times, ids))
    # numbers begin at 1, in the order in which people come
    walked = Trajectories(ids=ids[order] - 1, times=times[order], positions=positions[order], name="ours")
    return peers.Simulated(walked, seconds)


def runners(database: sc.MotionDatabase) -> dict[str, Runner]:
    """Everybody who can walk a scene here, by name."""
    found: dict[str, Runner] = {"ours": partial(ours, database)}
    if peers.are_installed():
        found |= {name: partial(peer, name) for name in peers.PEERS}
    else:
        print("RVO2 and JuPedSim are not installed (python bench/peers.py); on without them", file=sys.stderr)
    return found


def judge(walked: peers.Simulated, scene: Scene | None, situation: Plain, bounds: Any) -> CrowdScore:
    """Measures of what somebody walked; people are numbered as in the situation."""
    people = dict(enumerate(situation["people"]))
    here = set(walked.trajectories.people.tolist())
    return score_crowd(
        walked.trajectories,
        radius={k: p["radius"] for k, p in people.items() if k in here},
        scene=scene,
        bounds=bounds,
        free_speeds={k: p["speed"] for k, p in people.items() if k in here},
        goals={k: [np.array([stop]) for stop in p["stops"]] for k, p in people.items() if k in here and p["stops"]},
        ways={k: p["way"] for k, p in people.items() if k in here and p.get("way")},
        resolution=RESOLUTION,
    )


COLUMNS: dict[str, Callable[[CrowdScore], str]] = {
    "arrived": lambda s: f"{s.travel.arrived}/{int(s.travel.has_goal.sum())}",
    "overlaps": lambda s: f"{s.overlaps.pairs}",
    "cm": lambda s: f"{100 * s.overlaps.depth:.0f}",
    "walls": lambda s: f"{s.solid_overlaps.pairs}",
    "stuck": lambda s: f"{len({d.person for d in s.deadlocks})}",
    "time": lambda s: _median(s.travel.against_alone),
    "way": lambda s: _median(s.travel.detours),
    "Weidm.": lambda s: f"{s.speed_density.deviation:.2f}",
    "a 99 %": lambda s: f"{s.smoothness.acceleration_99:.1f}",
    "jerk": lambda s: f"{np.sqrt(s.smoothness.squared_jerk):.0f}",
    **{
        f"{kind[:5]} %": lambda s, kind=kind: "-" if s.violations is None else f"{100 * s.violations[kind].share:.2f}"
        for kind in ("speed", "tangential", "lateral", "jerk")
    },
}
"""Of each run: who arrives; pairs that overlap and how deep; pairs with walls; people in deadlocks; time and way
against alone; distance to Weidmann (m/s); acceleration (m/s2); root of the mean squared jerk (m/s3); samples beyond
human bounds."""


def _median(values: np.ndarray) -> str:
    return f"{np.median(values):.2f}" if len(values) else "-"


def line(who: str, score: CrowdScore, seconds: float) -> str:
    """One row of the table."""
    speed = score.samples / RATE / seconds if seconds > 0 else float("inf")
    cells = "".join(f"{column(score):>9s}" for column in COLUMNS.values())
    return f"  {who:16s}{cells}{seconds:8.2f} s {speed:7.0f}x"


def header() -> str:
    """Names of the columns; the last is seconds of all people walked in a second."""
    return f"  {'':16s}{''.join(f'{name:>9s}' for name in COLUMNS)}{'took':>10s}"


def draw(folder: Path, name: str, walked: peers.Simulated, situation: Plain) -> None:
    """Everybody's way, seen from above."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 7))
    for wall in situation["walls"]:
        axes.plot(*np.array(wall).T, color="black")
    for _, rows in walked.trajectories.each():
        places = walked.trajectories.positions[rows]
        axes.plot(*places.T, linewidth=0.8)
        axes.plot(*places[0], marker="o", markersize=3, color="gray")
    axes.set_aspect("equal")
    axes.set_title(name)
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / f"{name.replace(' ', '_')}.png", dpi=80)
    plt.close(figure)


def main() -> int:
    """Let everybody walk everything, and print."""
    usual = [name for name in SITUATIONS if name != "ring"]
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--situations", default=",".join(usual), help=f"of {', '.join(SITUATIONS)}")
    parser.add_argument("--seeds", type=int, default=1, help="so many of each")
    parser.add_argument("--database", help="whose bounds; the sample database if left out")
    parser.add_argument("--json", type=Path, help="writes all measures")
    parser.add_argument("--pictures", type=Path, help="draws all ways into this folder")
    wish = parser.parse_args()
    database = sc.load_database(wish.database) if wish.database else sc.sample_database()
    bounds = HumanBounds.of(database)
    content = []
    everybody = runners(database)
    ours(database, situation("head_on"), 0)  # compiles, which is no time of walking
    for name in wish.situations.split(","):
        for seed in range(wish.seeds):
            scene = situation(name, seed)
            numbers = plain(scene, seed)
            print(f"{name}, seed {seed}: {len(numbers['people'])} people")
            print(header())
            for who, run in everybody.items():
                begun = time.perf_counter()
                try:
                    walked = run(scene, seed)
                except peers.PeerError as error:
                    print(f"  {who:16s} fails after {time.perf_counter() - begun:.1f} s: {error}")
                    content.append({"situation": name, "seed": seed, "who": who, "error": str(error)})
                    continue
                score = judge(walked, scene, numbers, bounds)
                print(line(who, score, walked.seconds), flush=True)
                content.append({"situation": name, "seed": seed, "who": who, "took": walked.seconds, **score.as_json()})
                if wish.pictures:
                    draw(wish.pictures, f"{name} {seed} {who}", walked, numbers)
    if wish.json:
        wish.json.write_text(json.dumps(content, indent=1))
    return 0


if __name__ == "__main__":
    sys.exit(main())
