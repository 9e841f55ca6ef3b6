"""The scenes that tests build: what one test changes in its own, no other test may see."""

import pytest
from systems import EVERYTHING


def containers(value):
    """Every table and list within a value, by identity, with where it stands."""
    if not isinstance(value, (dict, list)):
        return {}
    found = {id(value): ""}
    for key, part in value.items() if isinstance(value, dict) else enumerate(value):
        found |= {which: f".{key}{where}" for which, where in containers(part).items()}
    return found


@pytest.mark.parametrize("name", EVERYTHING)
def test_two_scenes_share_nothing(name):
    # Both are kept alive: an identity is one only as long as its object lives.
    one, other = EVERYTHING[name](), EVERYTHING[name]()
    first, second = containers(one), containers(other)
    assert [first[which] for which in first.keys() & second.keys()] == []
