"""RVO2: optimal reciprocal collision avoidance (van den Berg et al. 2011), in the peers' environment.

RVO2 avoids, but finds no way; as in its own examples with roadmaps each person heads for the best point in sight, of
points beside the corners of what is solid.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pyrvo
import shapely
from scipy.sparse.csgraph import dijkstra

from peer_common import PASSED, REACH, main, solid

NEIGHBORS, HORIZON, SOLID_HORIZON, SIGHT = 10, 5.0, 1.0, 10.0
"""Of how many, how many seconds ahead, the same of what is solid, and within how many metres."""

FASTER = 1.3
"""People may go so much faster than they wish to avoid somebody."""

LOOK_AGAIN = 0.25
"""The best point in sight is looked for so often, seconds."""


class Roadmap:
    """Points beside corners, and lengths of the ways from them."""

    def __init__(self, situation) -> None:
        radius = max(person["radius"] for person in situation["people"])
        self.solid = solid(situation, 0.02)
        shapely.prepare(self.solid)
        corners = shapely.get_coordinates(self.solid.simplify(0.01))
        turns = np.arange(8) * np.pi / 4
        around = (radius + 0.15) * np.stack((np.sin(turns), np.cos(turns)), axis=-1)
        points = (corners[:, None] + around).reshape(-1, 2)
        clear = shapely.distance(shapely.points(points), self.solid) > radius + 0.05
        self.points = points[clear]
        self.wide = self.solid.buffer(0.9 * radius)
        shapely.prepare(self.wide)

    def sees(self, ones, others):
        """Which points see which."""
        lines = shapely.linestrings(np.stack(np.broadcast_arrays(ones[:, None], others[None]), axis=-2))
        return ~shapely.intersects(self.wide, lines)

    def toward(self, goals):
        """Lengths of the ways from the roadmap's points to each goal."""
        nodes = np.concatenate((self.points, goals))
        lengths = np.linalg.norm(nodes[:, None] - nodes[None], axis=-1)
        lengths[~self.sees(nodes, nodes)] = 0.0
        return dijkstra(lengths, indices=np.arange(len(self.points), len(nodes)))[:, : len(self.points)]


def simulate(situation, frame_rate, _arguments, note) -> None:
    """Walk."""
    people = situation["people"]
    dt = 1 / frame_rate
    fastest = FASTER * max(p["speed"] for p in people)
    sim = pyrvo.RVOSimulator(dt, SIGHT, NEIGHBORS, HORIZON, SOLID_HORIZON, 0.25, fastest)
    for p in people:
        sim.add_agent(
            tuple(p["start"]), SIGHT, NEIGHBORS, HORIZON, SOLID_HORIZON, p["radius"], FASTER * p["speed"], (0.0, 0.0)
        )
    for wall in situation["walls"]:
        for one, other in pairwise(wall):
            sim.add_obstacle([tuple(one), tuple(other)])
    for polygon in situation["polygons"]:
        sim.add_obstacle(anticlockwise(shapely.Polygon(polygon)))
    for x, z, r in situation["circles"]:
        sim.add_obstacle(anticlockwise(shapely.Point(x, z).buffer(r, quad_segs=4)))
    sim.process_obstacles()
    blocked = bool(situation["walls"] or situation["polygons"] or situation["circles"])
    roadmap = Roadmap(situation) if blocked else None
    stops = [np.array(p["stops"], float).reshape(-1, 2) for p in people]
    ways = [roadmap.toward(own) for own in stops] if roadmap is not None else None
    at = np.zeros(len(people), int)
    there = np.array([len(own) == 0 for own in stops])
    gone = np.zeros(len(people), bool)
    heads = np.array([own[0] if len(own) else p["start"] for own, p in zip(stops, people, strict=True)], float)
    look = max(1, round(LOOK_AGAIN * frame_rate))
    rng = np.random.default_rng(0)
    for frame in range(round(situation["seconds"] * frame_rate) + 1):
        positions = np.array([(v.x, v.y) for v in map(sim.get_agent_position, range(len(people)))])
        here = np.flatnonzero(~gone)
        note(frame, here, positions[here])
        for k in here:
            last = at[k] + 1 >= len(stops[k])
            if not there[k] and np.linalg.norm(positions[k] - stops[k][at[k]]) <= (REACH if last else PASSED):
                if not last:
                    at[k] += 1
                    heads[k] = stops[k][at[k]]
                else:
                    # nobody can be taken out of RVO2: they are put far away
                    gone[k] = there[k] = True
                    sim.set_agent_position(int(k), (1e4 + 100.0 * int(k), 1e4))
                    sim.set_agent_pref_velocity(int(k), (0.0, 0.0))
        if gone.all() or there.all():
            break
        if roadmap is not None and frame % look == 0:
            steer(roadmap, ways, positions, stops, at, ~there, heads)
        for k in np.flatnonzero(~there):
            way = heads[k] - positions[k]
            far = float(np.linalg.norm(way))
            wish = way / max(far, 1e-9) * min(people[k]["speed"], far / dt)
            # a breath of chance, as in RVO2's examples, against perfect symmetry
            wish = wish + 1e-3 * rng.normal(size=2)
            sim.set_agent_pref_velocity(int(k), (float(wish[0]), float(wish[1])))
        sim.do_step()


def steer(roadmap, ways, positions, stops, at, going, heads) -> None:
    """Head everybody for the stop if it is in sight, else for the point in sight from which it is nearest."""
    who = np.flatnonzero(going)
    goals = np.array([stops[k][at[k]] for k in who])
    lines = shapely.linestrings(np.stack((positions[who], goals), axis=1))
    direct = ~shapely.intersects(roadmap.wide, lines)
    heads[who[direct]] = goals[direct]
    for k in who[~direct]:
        costs = ways[k][at[k]] + np.linalg.norm(roadmap.points - positions[k], axis=-1)
        seen = roadmap.sees(positions[k : k + 1], roadmap.points)[0] & np.isfinite(costs)
        if seen.any():
            heads[k] = roadmap.points[np.argmin(np.where(seen, costs, np.inf))]


def anticlockwise(polygon):
    """Corners of a polygon as RVO2 wants them."""
    return [tuple(c) for c in shapely.get_coordinates(shapely.geometry.polygon.orient(polygon))[:-1]]


if __name__ == "__main__":
    main(simulate)
