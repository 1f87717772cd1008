"""A character driven by forces, as a joystick gives them: walk, lean to the left, run, let go.

python examples/joystick.py [DATABASE]
"""

from __future__ import annotations

import sys

import numpy as np

import stridecast as sc


def main() -> None:
    walker = sc.Walker(sc.load_database(sys.argv[1]) if len(sys.argv) > 1 else sc.sample_database())
    heading = 0.0
    for frame in range(240):
        seconds = frame / walker.frame_rate
        push, lean = (1.0, 0.0) if seconds < 2 else (0.0, 1.0) if seconds < 5 else (2.0, 0.0)
        force = push * np.array([np.sin(heading), np.cos(heading)]) + lean * np.array(
            [np.cos(heading), -np.sin(heading)]
        )
        pose = walker.step(force=force, motion="walk" if seconds < 5 else "run")
        heading = float(pose.vehicle.heading)
        if frame % 15 == 0:
            x, z = pose.vehicle.position
            speed = np.linalg.norm(pose.vehicle.velocity)
            print(f"{seconds:5.2f} s  {pose.group:14s} at ({x:6.2f}, {z:6.2f})  {speed:.2f} m/s")


if __name__ == "__main__":
    main()
