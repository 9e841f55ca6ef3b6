"""What is kept for what is alike: numbering and layouts by structure, loads by member, answers of a state."""

import numpy as np
import pytest
from scenes import made, plane_loads
from systems import EVERY, SYSTEMS

from sfetcas.equilibria.statics import solve
from sfetcas.mathematics.keeping import Recent
from sfetcas.mechanics import positions
from sfetcas.mechanics.accuracy import WITHIN, largest_difference
from sfetcas.mechanics.mesh import uniform_mesh
from sfetcas.mechanics.model import assemble


def test_what_was_not_used_for_longest_makes_room():
    made_now, recent = list[int](), Recent[int](room=10, largest=6)

    def found(key, size=4):
        return recent.found(key, lambda: made_now.append(key) or key, lambda _: size)

    assert [found(1), found(2), found(1)] == [1, 2, 1]
    assert found(3) == 3
    # The second was used before the first.
    assert [found(1), found(2)] == [1, 2]
    assert made_now == [1, 2, 3, 2]
    # What is too large is made each time, and drives out nothing.
    assert [found(4, 7), found(4, 7), found(1)] == [4, 4, 1]
    assert made_now == [1, 2, 3, 2, 4, 4]


@pytest.mark.parametrize("name", SYSTEMS)
def test_models_of_one_structure_share_the_maps_of_places(name, monkeypatch):
    """Also where all numbers are others; they are those that are made anew."""
    scene = made(EVERY[name]())
    first = assemble(scene, uniform_mesh(scene, 2, 3))
    monkeypatch.setattr(positions, "_KNOWN", Recent(10**6, 10**6))
    anew = assemble(scene, uniform_mesh(scene, 2, 3))
    loads = {f"loads.{n}.value": (1.5 * np.array(load.value)).tolist() for n, load in scene.loads.items()}
    heavier = scene.replace(loads)
    other = assemble(heavier, uniform_mesh(heavier, 2, 3))
    assert other.positions is anew.positions
    for part in ("E", "Y", "B", "Z", "W", "BZ"):
        one, two = (getattr(model.positions, part) for model in (first, anew))
        np.testing.assert_array_equal(one.full(), two.full())
    assert first.positions.unknowns == anew.positions.unknowns
    # Another mesh is another structure.
    assert assemble(scene, uniform_mesh(scene, 2, 4)).positions is not anew.positions or not anew.mesh.elements


def test_loads_along_members_are_those_of_the_scene_also_of_a_copy():
    scene = made(plane_loads())
    for name in scene.members:
        own = [load for load in scene.loads.values() if load.member == name]
        assert list(scene.loads_along.get(name, ())) == own
    assert scene.loads_along
    assert not scene.model_copy(update={"loads": {}}).loads_along


@pytest.mark.parametrize("name", SYSTEMS)
def test_differences_of_meshes_are_those_of_positions(name):
    scene = made(EVERY[name]())
    coarse, fine = (solve(scene, elements=count).last.fields for count in (2, 5))
    apart = []
    for member, cuts in coarse.model.mesh.cuts.items():
        x = np.append((cuts[:-1, None] + np.diff(cuts)[:, None] * WITHIN).ravel(), 1.0)
        apart.append(np.linalg.norm(coarse.positions(member, x) - fine.positions(member, x), axis=1).max())
    # Positions have rounding of their own size.
    assert largest_difference(coarse, fine) == pytest.approx(max(apart) / scene.size, abs=1e-13)
