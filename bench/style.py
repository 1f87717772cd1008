"""Whether gloomy and brisk walkers are told from neutral ones, and what is said of recordings.

    python bench/style.py [RECORDINGS_FOLDER]

Sample takes of courses that the rest of the database does not show, made anew in each manner, are judged one by one
against neutral takes.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from itertools import product

import numpy as np

import stridecast as sc
from stridecast.samples.corpus import RECIPES, sample_take, sample_takes

COURSES = (
    "walk_veer_usual",
    "walk_turns_slow",
    "walk_circles",
    "walk_changes",
    "walk_slower",
    "run_faster",
    "run_turns",
)
STYLES = ("gloomy", "neutral", "brisk")


def main() -> None:
    """Judge, and print."""
    recipes = {recipe.name: recipe for recipe in RECIPES}
    known = [take.motion for take in sample_takes() if take.style == "neutral" and take.motion.name not in COURSES]
    scores: dict[tuple[str, str], np.ndarray] = {}
    for number, (course, style) in enumerate(product(COURSES, STYLES)):
        recipe = replace(recipes[course], style=style, name=f"{style} {course}")
        database = sc.build([*known, sample_take(recipe, seed=900 + number).motion], cache=False, jobs=1, mirror=False)
        last = len(database.takes) - 1
        scores[course, style] = database.annotations.style[database.examples.takes == last]
    for course in COURSES:
        told = [
            f"{style} {own.mean():+.2f} ({own.min():+.2f} to {own.max():+.2f})"
            for style, own in ((style, scores[course, style]) for style in STYLES)
        ]
        print(f"{course:18}", "   ".join(told))
    neutral = np.concatenate([scores[course, "neutral"] for course in COURSES])
    for style in ("gloomy", "brisk"):
        own = np.concatenate([scores[course, style] for course in COURSES])
        higher = (own[:, None] > neutral).mean()
        print(f"{style}: a half cycle is told from a neutral one: {100 * max(higher, 1 - higher):.1f} % (chance 50)")
    if len(sys.argv) > 1:
        takes = [take for take in sc.build(sys.argv[1]).takes if take.annotation]
        for take in sorted(takes, key=lambda take: take.annotation.style):
            told = take.annotation
            print(f"{take.annotation.style:+.2f}  {take.name:12} {told.speed:.2f} m/s  {' > '.join(told.statuses)}")


if __name__ == "__main__":
    main()
