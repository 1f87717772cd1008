"""Simulators of other people, to be measured beside: RVO2 (ORCA) and JuPedSim, in an environment of their own.

    python bench/peers.py        makes bench/.peers and installs them (some gigabytes)

They share no dependency with the package: each runs in a process that reads a situation as JSON and writes where
everybody was.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from stridecast.model.trajectories import Trajectories

HERE = Path(__file__).resolve().parent
HOME = HERE / ".peers"
PYTHON = HOME / ("Scripts" if os.name == "nt" else "bin") / "python"

PINS = ("pyrvo==0.4.3", "jupedsim==1.4.2", "numpy==2.4.6", "shapely==2.2.0", "scipy==1.17.1")

PEERS = {
    "RVO2": ("peer_rvo2.py",),
    "JuPedSim speed": ("peer_jupedsim.py", "CollisionFreeSpeedModel"),
    "JuPedSim force": ("peer_jupedsim.py", "SocialForceModel"),
}
"""Script and arguments of each."""

LONGEST = 600.0
"""A situation may take so long, seconds."""


class Simulated(NamedTuple):
    """Where people were, and how long it took to compute, seconds."""

    trajectories: Trajectories
    seconds: float


class PeerError(Exception):
    """A peer that fails, with what it says."""


def install() -> None:
    """Make the environment, or renew it."""
    venv.create(HOME, with_pip=True, clear=True)
    subprocess.run([PYTHON, "-m", "pip", "install", "--disable-pip-version-check", *PINS], check=True)


def are_installed() -> bool:
    """Whether the peers can run."""
    return PYTHON.exists()


def simulate(peer: str, situation: dict[str, Any], frame_rate: float = 30.0) -> Simulated:
    """Let a peer walk a situation.

    Parameters
    ----------
    peer
        One of ``PEERS``.
    situation
        ``people`` (each with ``start``, ``stops``: points in turn, ``speed``, ``radius``), ``walls`` (each a list of
        points), ``circles`` (each ``x, z, radius``), ``polygons`` (each a list of points) and ``seconds``: plain
        numbers on the ground, metres and m/s.
    frame_rate
        At which the trajectories are sampled, Hz. The peers take steps of their own.

    Raises
    ------
    PeerError
        It ends with an error or takes too long.
    """
    script, *arguments = PEERS[peer]
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "walked.npz"
        command = [str(PYTHON), str(HERE / script), str(out), f"{frame_rate:g}", *arguments]
        try:
            done = subprocess.run(
                command, input=json.dumps(situation), text=True, capture_output=True, timeout=LONGEST, check=False
            )
        except subprocess.TimeoutExpired:
            raise PeerError(f"{peer} takes more than {LONGEST:g} s") from None
        if done.returncode or not out.exists():
            raise PeerError(f"{peer}: {done.stderr.strip().splitlines()[-1] if done.stderr.strip() else 'no output'}")
        with np.load(out) as walked:
            ids, frames, positions = walked["ids"], walked["frames"], walked["positions"]
            seconds = float(walked["seconds"])
    order = np.lexsort((frames, ids))
    return Simulated(
        Trajectories(ids=ids[order], times=frames[order] / frame_rate, positions=positions[order], name=peer), seconds
    )


if __name__ == "__main__":
    install()
    sys.exit(0)
