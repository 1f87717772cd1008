"""JuPedSim with one of its models and their usual parameters, in the peers' environment. It finds ways by itself."""

from __future__ import annotations

from itertools import pairwise

import jupedsim as jps
import numpy as np
import shapely

from peer_common import PASSED, REACH, main, solid

SUBSTEPS = {"CollisionFreeSpeedModel": 4, "SocialForceModel": 4}
"""Steps from frame to frame; with 30 Hz near the 0.01 s that JuPedSim takes by itself."""

MARGIN = 6.0
"""So much ground is around everything, metres."""

THICK = 0.02
"""Of walls, metres."""


def simulate(situation, frame_rate, arguments, note) -> None:
    """Walk."""
    name = arguments[0]
    people = situation["people"]
    points = [p["start"] for p in people] + [stop for p in people for stop in p["stops"]]
    points += [point for wall in situation["walls"] for point in wall]
    ground = shapely.MultiPoint(points).envelope.buffer(MARGIN, join_style="mitre")
    open_ground = ground.difference(solid(situation, THICK))
    if open_ground.geom_type != "Polygon":
        parts = shapely.get_parts(open_ground)
        held = [part for part in parts if part.buffer(1e-6).covers(shapely.MultiPoint([p["start"] for p in people]))]
        if not held:
            raise SystemExit("people are in rooms that nothing joins")
        open_ground = held[0]
    sim = jps.Simulation(model=getattr(jps, name)(), geometry=open_ground, dt=1 / frame_rate / SUBSTEPS[name])
    parameters = getattr(jps, f"{name}AgentParameters")
    who: dict[int, int] = {}
    left: dict[int, list[np.ndarray]] = {}
    for k, p in enumerate(people):
        stops = [np.array(stop, float) for stop in p["stops"]] or [np.array(p["start"], float)]
        stages = [sim.add_waypoint_stage(tuple(stop), PASSED) for stop in stops[:-1]]
        stages.append(sim.add_waypoint_stage(tuple(stops[-1]), REACH))
        journey = jps.JourneyDescription(stages)
        for one, other in pairwise(stages):
            journey.set_transition_for_stage(one, jps.Transition.create_fixed_transition(other))
        agent = sim.add_agent(
            parameters(
                position=tuple(p["start"]),
                desired_speed=p["speed"],
                radius=p["radius"],
                journey_id=sim.add_journey(journey),
                stage_id=stages[0],
            )
        )
        who[agent] = k
        left[agent] = [np.array(stop, float) for stop in p["stops"]]
    for frame in range(round(situation["seconds"] * frame_rate) + 1):
        agents = [(agent.id, np.array(agent.position)) for agent in sim.agents()]
        note(frame, [who[number] for number, _ in agents], [place for _, place in agents])
        for number, place in agents:
            stops = left[number]
            if stops and np.linalg.norm(place - stops[0]) <= (PASSED if len(stops) > 1 else REACH):
                stops.pop(0)
                if not stops:
                    sim.mark_agent_for_removal(number)
        if not any(left.values()):
            break
        for _ in range(SUBSTEPS[name]):
            sim.iterate()


if __name__ == "__main__":
    main(simulate)
