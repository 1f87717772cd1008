"""The rules by which people avoid each other, with the words for them (BJL section 5)."""

from __future__ import annotations

RULES = (
    "on the way",
    "go on",
    "pass head-on",
    "overtake",
    "follow",
    "pass behind",
    "go first",
    "slow down",
    "pass round",
    "other side",
    "wait",
    "give way",
    "back to the way",
    "stand",
    "keep room to stop",
)
"""Names of the rules; their places are the codes in ``Moving.rule``."""

(
    ON_THE_WAY,
    GO_ON,
    HEAD_ON,
    OVERTAKE,
    FOLLOW,
    BEHIND,
    GO_FIRST,
    SLOW_DOWN,
    PASS_ROUND,
    OTHER_SIDE,
    WAIT,
    GIVE_WAY,
    RETURN,
    STAND,
    HELD,
) = range(len(RULES))

WHY = {
    ON_THE_WAY: "nobody is in the way",
    GO_ON: "{other} comes head-on in {time:.1f} s and gives way",
    HEAD_ON: "{other} comes head-on in {time:.1f} s; passing on the {side}",
    OVERTAKE: "{other} is slower and would be reached in {time:.1f} s; there is room on the {side}",
    FOLLOW: "{other} is ahead and would be reached in {time:.1f} s; there is no room beside",
    BEHIND: "{other} crosses and would be met in {time:.1f} s; passing behind",
    GO_FIRST: "{other} comes from the side and would be met in {time:.1f} s; going first",
    SLOW_DOWN: "{other} crosses and would be met in {time:.1f} s; there is no room behind",
    PASS_ROUND: "{other} stands in the way, {time:.1f} s ahead; passing on the {side}",
    OTHER_SIDE: "{other} is still in the way, {time:.1f} s ahead; trying the other side, the {side}",
    WAIT: "{other} is still in the way; stopping for a while",
    GIVE_WAY: "nothing moves any more; making room",
    RETURN: "nobody is in the way; back to the way along its tangent",
    STAND: "standing",
    HELD: "there would be no room left to stop",
}
"""Why a rule is followed, for people to read."""
