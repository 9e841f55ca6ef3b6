"""Many solves at once: numbers as of single solves whoever solves them, failures kept, tables, bad input, commands."""

import csv
import json
import os
import shutil
import subprocess
import sys
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from scenes import cantilever, made

from benchmarks.scenes import lee_frame
from sfetcas import (
    Analysis,
    LogNormal,
    Normal,
    SceneError,
    Settings,
    SolveError,
    Status,
    Uniform,
    changed,
    dump,
    grid,
    load,
    sampled,
    solve,
    sweep,
)
from sfetcas.cli import main
from sfetcas.description.answers import answer_name
from sfetcas.processes import context_of
from sfetcas.sweeps import feeding, work
from sfetcas.sweeps.cases import Cases, read_cases
from sfetcas.sweeps.quantities import wanted_of
from sfetcas.sweeps.workers import Workers

TIP, ROOT = "nodes.B.position", "members.m.moment at 0"
FORCES = {"loads.tip.value.1": [0.5, 3.0, 1.0, 2.0, 8.0, 0.1]}
SCENE = made(cantilever())


class Here(Executor):
    """Does everything at once, by itself."""

    def submit(self, fn, /, *args, **kwargs):
        future = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


def here(scene, cases, quantities=(TIP,), **more):
    return sweep(scene, cases, quantities, executor=Here(), **more)


@pytest.fixture
def no_solver(monkeypatch):
    """What cases are solved by, replaced: by what a function of the scene says."""

    def replaced(answer):
        monkeypatch.setattr(work, "solve", lambda scene, settings: answer(scene))

    return replaced


# -- numbers ----------------------------------------------------------------------------------------------


def test_each_case_is_a_solve_of_the_changed_scene_to_the_last_bit():
    found = here(SCENE, FORCES, [TIP, ROOT])
    for i, force in enumerate(FORCES["loads.tip.value.1"]):
        step = solve(changed(SCENE, {"loads.tip.value.1": force})).last
        assert np.array_equal(found.values(TIP)[i], step.position("B"))
        assert np.array_equal(found.values(ROOT)[i], step.along("m", [0.0])["moment"][0])
        assert found.table["error_estimate"][i] == step.certificate.error_estimate
    assert list(found.table["status"]) == ["solved"] * 6
    assert found.failures == ()


def test_numbers_do_not_depend_on_order_chunks_or_threads():
    found = here(SCENE, FORCES)
    backwards = here(SCENE, {name: values[::-1] for name, values in FORCES.items()}, chunk=6)
    assert np.array_equal(backwards.values(TIP)[::-1], found.values(TIP))
    with ThreadPoolExecutor(3) as threads:
        threaded = sweep(SCENE, FORCES, [TIP], executor=threads, chunk=2)
        assert threads.submit(int).result() == 0, "it was shut down"
    assert np.array_equal(threaded.values(TIP), found.values(TIP))


def test_processes_give_the_same_bits_and_failures():
    cases = {**FORCES, "sections.s.EI3": [1.0, -1.0, 2.0, 1.0, 1.0, 1.0]}
    found, apart = here(SCENE, cases), sweep(SCENE, cases, [TIP], workers=2, chunk=1)
    assert np.array_equal(apart.values(TIP), found.values(TIP), equal_nan=True)
    assert apart.failures == found.failures
    assert [failure.case for failure in found.failures] == [1]


@pytest.mark.parametrize(
    ("scene", "quantity", "told"),
    [
        (SCENE.replace(analysis=Analysis(steps=[0.5, 1])), f"{TIP} step 0.5", lambda a: a.steps[0].position("B")),
        (SCENE.replace(analysis=Analysis(type="modes", modes=2)), "modes.omega", lambda a: a.omega),
        (
            SCENE.replace(analysis=Analysis(type="dynamic", end=0.2, step=0.05)),
            "nodes.B.velocity time 0.075",
            lambda a: a.at(0.075).velocity("B"),
        ),
        (
            lee_frame().replace(analysis=Analysis(type="path", range=[0, 2.5], accuracy=1e-3, points=30)),
            "factor limit_point 1",
            lambda a: [a.limit_points[0].factor],
        ),
    ],
    ids=["static", "modes", "dynamic", "path"],
)
@pytest.mark.usefixtures("interpreted")
def test_quantities_of_every_analysis(scene, quantity, told):
    section = next(iter(scene.sections))
    value = 1.2 * scene.sections[section].EI3
    found = here(scene, {f"sections.{section}.EI3": [value]}, [quantity])
    # A motion tells of the time that is asked for as of its own.
    wanted = wanted_of(scene, [quantity])[0].expect
    asked = changed(scene, {f"sections.{section}.EI3": value}).replace(expect=[wanted])
    assert np.array_equal(np.atleast_1d(found.values(quantity)[0]), told(solve(asked)))


def test_names_with_spaces_and_words_of_selectors_are_names():
    table = cantilever()
    table["nodes"]["x step 2"] = table["nodes"].pop("B")
    table["members"] = {"the m at 1": {**table["members"]["m"], "nodes": ["A", "x step 2"]}}
    table["loads"]["tip"]["node"] = "x step 2"
    tip, root = "nodes.x step 2.position", "members.the m at 1.force at 0"
    found = here(made(table), {"loads.tip.value.1": [1.0]}, [tip, root], settings=Settings(accuracy_of=root))
    assert list(found.table)[1:7] == [*(f"{tip}.{i}" for i in range(3)), *(f"{root[:-5]}.{i} at 0" for i in range(3))]
    assert answer_name("nodes.x at 2.position").record == "x at 2"


def test_of_several_equilibria_the_default_one_is_taken(no_solver):
    scene = SCENE.replace(analysis=Analysis(equilibria="all"))
    found = here(scene, {"loads.tip.value.1": [40.0]}, [TIP])
    answer = solve(changed(scene, {"loads.tip.value.1": 40.0}))
    assert len(answer.steps) > 1
    assert np.array_equal(found.values(TIP)[0], answer.steps[0].position("B"))


def test_lists_take_a_column_for_each_number():
    found = here(SCENE, {"loads.tip.value": [[0.0, 1.0], [0.5, 2.0]]})
    single = here(SCENE, {"loads.tip.value.0": [0.0, 0.5], "loads.tip.value.1": [1.0, 2.0]})
    assert list(found.cases.columns) == list(single.cases.columns)
    assert np.array_equal(found.values(TIP), single.values(TIP))


def test_numbers_that_change_how_many_unknowns_there_are_work():
    table = cantilever()
    table["members"]["m"] |= {"element": "SFET3", "elements": 1}
    found = here(made(table), {"members.m.elements": [1, 2, 8]}, [TIP, "certificate.error_estimate"])
    exact = solve(SCENE, accuracy=1e-10).last.position("B")
    errors = np.abs(found.values(TIP) - exact).max(axis=1)
    assert found.solved.all()
    # of order four: an eighth of the length far below a hundredth of the error
    assert errors[1] < errors[0] / 4
    assert errors[2] < errors[0] / 100
    refused = here(made(table), {"members.m.elements": [1.5]}, [TIP])
    assert "members.m.elements: found 1.5" in refused.failures[0].reason


def test_a_place_and_where_it_goes_have_columns_of_their_own():
    found = here(SCENE, {"nodes.B.position.0": [1.0, 1.1]})
    assert list(found.table["nodes.B.position.0"]) == [1.0, 1.1]
    assert np.array_equal(found.table["answer.nodes.B.position.0"], found.values(TIP)[:, 0])
    assert np.array_equal(found.table["nodes.B.position.1"], found.values(TIP)[:, 1])


def test_what_an_answer_may_be_without_is_left_open():
    floor = {"floor": {"type": "plane", "point": [0, -0.3], "normal": [0, 1], "members": "all"}}
    scene = made({**cantilever((0.0, -0.1)), "contacts": floor})
    found = here(scene, {"loads.tip.value.1": [-0.1, -3.0]}, ["contacts.floor.at", TIP])
    assert found.solved.all()
    assert np.isnan(found.values("contacts.floor.at")[0])
    assert ["there is no contacts.floor.at" in notes for notes in found.table["notes"]] == [True, False]
    assert found.values("contacts.floor.at")[1] == pytest.approx(1.0, abs=1e-6)  # the end, to rounding of its place


# -- failures ---------------------------------------------------------------------------------------------


def test_failures_keep_their_reason_and_the_others_their_numbers(no_solver):
    errors = {
        1.0: SolveError(Status.ITERATIONS, "of this test"),
        2.0: SceneError("of this test", ("nodes",)),
        3.0: np.linalg.LinAlgError("singular"),
        4.0: MemoryError(),
    }

    def answer(scene):
        force = scene.loads["tip"].value[1]
        if force in errors:
            raise errors[force]
        return solve(scene)

    no_solver(answer)
    found = here(SCENE, {"loads.tip.value.1": [0.5, 1.0, 2.0, 3.0, 4.0, 5.0]}, chunk=3)
    assert list(found.solved) == [True, False, False, False, False, True]
    assert [(f.case, f.status, f.reason) for f in found.failures] == [
        (1, "failed", "the solver used up its iterations (of this test)"),
        (2, "refused", "nodes: of this test"),
        (3, "failed", "the numbers of this case leave what can be computed (singular)"),
        (4, "failed", "the case needs more memory than there is"),
    ]
    assert found.failures[0].values == {"loads.tip.value.1": 1.0}
    assert np.isnan(found.values(TIP)[1:5]).all()
    assert np.isfinite(found.values(TIP)[[0, 5]]).all()


def test_what_is_short_of_the_accuracy_has_numbers_and_says_so():
    found = here(SCENE, {"loads.tip.value.1": [20.0]}, settings=Settings(accuracy=1e-9, element="SFET2", elements=4))
    assert found.table["status"][0] == "short"
    assert found.table["reason"][0] == "solved, but not to the accuracy asked for"
    assert np.isfinite(found.values(TIP)).all()


def test_a_mistake_in_one_case_costs_this_case_only(no_solver):
    def answer(scene):
        return solve(scene) if scene.loads["tip"].value[1] != 3.0 else 1 / 0

    no_solver(answer)
    found = here(SCENE, FORCES, chunk=4)
    assert [(f.case, f.reason) for f in found.failures] == [(1, "ZeroDivisionError: division by zero")]
    assert np.array_equal(found.solved, [True, False, True, True, True, True])


def deadly(data, values):
    """Solves, but of one case its process dies."""
    if [3.0] in values:
        os._exit(1)
    return work.solve_chunk(data, values)


def test_a_process_that_dies_takes_only_its_case_along(monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(feeding, "solve_chunk", deadly)
        found = sweep(SCENE, FORCES, [TIP], workers=1, chunk=2)
    assert [(f.case, f.status, f.reason) for f in found.failures] == [
        (1, "failed", "the process that solved it died, twice")
    ]
    assert np.array_equal(found.values(TIP)[found.solved], here(SCENE, FORCES).values(TIP)[found.solved])


class Breaking(Here):
    """Breaks at its third piece of work, for good."""

    count = 0

    def submit(self, fn, /, *args, **kwargs):
        self.count += 1
        if self.count >= 3:
            raise BrokenExecutor("of this test")
        return super().submit(fn, *args, **kwargs)


def test_an_executor_that_breaks_leaves_what_it_did():
    found = sweep(SCENE, FORCES, [TIP], executor=Breaking(), chunk=2)
    assert list(found.solved) == [True, True, True, True, False, False]
    assert found.failures[-1].status == "not run"
    assert found.failures[-1].reason == "the executor takes no more work (BrokenExecutor: of this test)"


@pytest.mark.parametrize("own", [True, False])
def test_an_interrupt_keeps_what_is_done(own):
    done = []

    def told(more):
        done.append(more)
        if len(done) == 2:
            raise KeyboardInterrupt

    how = {"workers": 1} if own else {"executor": Here()}
    found = sweep(SCENE, {"loads.tip.value.1": np.linspace(0.1, 2.0, 40)}, [TIP], chunk=2, progress=told, **how)
    assert found.interrupted
    assert 4 <= found.solved.sum() < 40 or not own
    assert np.isfinite(found.values(TIP)[:4]).all()
    assert {f.reason for f in found.failures} <= {"interrupted before"}


def test_where_no_socket_may_have_its_name_processes_start_otherwise(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / ("d" * 110)))
    with Workers(1) as own:
        assert own.submit(os.getpid).result() != os.getpid()
    assert context_of([]).get_start_method() == "spawn"


def test_progress_counts_every_case():
    told = []
    here(SCENE, FORCES, progress=told.append, chunk=4)
    assert told == [4, 2]


# -- clusters ---------------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore")  # those of a cluster are its own
def test_a_cluster_of_dask_gives_the_same_bits():
    distributed = pytest.importorskip("distributed")
    cases = {**FORCES, "sections.s.EI3": [1.0, -1.0, 2.0, 1.0, 1.0, 1.0]}
    local = distributed.LocalCluster(n_workers=2, threads_per_worker=2, dashboard_address=None)
    with local as cluster, distributed.Client(cluster) as client:
        found = sweep(SCENE, cases, [TIP, ROOT], executor=client.get_executor())
        assert client.submit(int).result() == 0, "it was shut down"
    single = here(SCENE, cases, [TIP, ROOT])
    for name in (TIP, ROOT):
        assert np.array_equal(found.values(name), single.values(name), equal_nan=True)
    assert found.failures == single.failures


MPI = """
import sys
from mpi4py.futures import MPIPoolExecutor
from sfetcas import load, sweep
if __name__ == "__main__":
    with MPIPoolExecutor() as executor:
        assert executor.num_workers == 2
        sweep(load(sys.argv[1]), {"loads.tip.value.1": %r}, [%r], executor=executor).save(sys.argv[2])
"""


def test_mpi_gives_the_same_bits(tmp_path):
    pytest.importorskip("mpi4py")
    start = shutil.which("mpiexec", path=os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]))
    if start is None:
        pytest.skip("no mpiexec is there")
    program, scene, table = tmp_path / "program.py", tmp_path / "scene.json", tmp_path / "table.npz"
    program.write_text(MPI % (FORCES["loads.tip.value.1"], TIP))
    dump(SCENE, scene)
    command = [start, "-n", "3", sys.executable, "-m", "mpi4py.futures", program, scene, table]
    run = subprocess.run(command, capture_output=True, text=True, timeout=120)
    if "cannot load MPI library" in run.stderr:
        pytest.skip("no MPI library is there")
    assert run.returncode == 0, run.stderr
    found, single = np.load(table), here(SCENE, FORCES)
    assert all(np.array_equal(found[f"{TIP}.{i}"], single.values(TIP)[:, i]) for i in range(3))


# -- cases ------------------------------------------------------------------------------------------------


def test_a_grid_has_all_combinations_the_last_name_fastest():
    found = grid({"a": [1, 2], "b": [10, 20, 30], "c": [[1, 2]]}).columns
    assert found["a"].tolist() == [1, 1, 1, 2, 2, 2]
    assert found["b"].tolist() == [10, 20, 30, 10, 20, 30]
    assert found["c"].tolist() == [[1, 2]] * 6


DRAWN = {"n": Normal(3.0, 0.5), "l": LogNormal(2.0, 0.3), "u": Uniform(-1.0, 4.0)}


@pytest.mark.parametrize("method", ["random", "latin"])
def test_samples_have_the_means_and_deviations_asked_for(method):
    count = 20_000
    found = sampled(count, DRAWN, seed=3, method=method)
    assert found.random
    for name, mean, deviation in (("n", 3.0, 0.5), ("l", 2.0, 0.3), ("u", 1.5, 5.0 / np.sqrt(12.0))):
        column = found.columns[name]
        # five standard errors; that of a deviation is at most that of the mean for such light tails
        assert abs(column.mean() - mean) < 5.0 * deviation / np.sqrt(count)
        assert abs(column.std() - deviation) < 5.0 * deviation / np.sqrt(count)
    assert (found.columns["l"] > 0.0).all()
    # independent of each other: five standard errors of a correlation
    assert abs(np.corrcoef(found.columns["n"], found.columns["u"])[0, 1]) < 5.0 / np.sqrt(count)


def test_samples_are_the_same_for_the_same_seed_and_go_on():
    one, other = sampled(50, DRAWN, seed=7), sampled(80, DRAWN, seed=7)
    assert all(np.array_equal(one.columns[name], other.columns[name][:50]) for name in DRAWN)
    assert not np.array_equal(one.columns["n"], sampled(50, DRAWN, seed=8).columns["n"])
    # the first number of this generator, which NumPy keeps from version to version
    assert sampled(1, {"u": Uniform(0.0, 1.0)}, seed=0).columns["u"][0] == pytest.approx(0.6369616873214543)


def test_a_latin_hypercube_has_one_sample_in_each_interval():
    found = sampled(40, {"a": Uniform(0, 40), "b": Uniform(0, 40)}, method="latin").columns
    for column in found.values():
        assert sorted(np.floor(column)) == list(range(40))
    assert not np.array_equal(np.floor(found["a"]), np.floor(found["b"]))


def test_cases_are_read_from_a_table(tmp_path):
    table = tmp_path / "cases.csv"
    table.write_text("\ufeffloads.tip.value.1, sections.s.EI3\r\n1,2.5\r\n\r\n-3e-1,1\r\n")
    found = read_cases(table).columns
    assert {name: column.tolist() for name, column in found.items()} == {
        "loads.tip.value.1": [1.0, -0.3],
        "sections.s.EI3": [2.5, 1.0],
    }


# -- results ----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def found():
    return here(SCENE, {"sections.s.EI3": [1.0, -1.0, 2.0, 1.5]}, [TIP, "reactions.A.force", "energy.elastic"])


def test_statistics_are_over_the_solved_cases(found):
    rows = found.values(TIP)[[0, 2, 3]]
    assert np.array_equal(found.mean(TIP), rows.mean(axis=0))
    assert np.array_equal(found.deviation(TIP), rows.std(axis=0, ddof=1))
    assert np.array_equal(found.standard_error(TIP), rows.std(axis=0, ddof=1) / np.sqrt(3.0))
    assert np.array_equal(
        found.quantiles("energy.elastic", [0.0, 0.5, 1.0])[1], np.median(found.values("energy.elastic")[[0, 2, 3]])
    )


def test_csv_is_read_back_with_all_digits(found, tmp_path):
    path = tmp_path / "table.csv"
    found.save(path)
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    assert b"\r\n" in path.read_bytes()
    assert list(rows[0]) == list(found.table)
    assert [row["status"] for row in rows] == ["solved", "refused", "solved", "solved"]
    assert rows[1]["reason"] == "sections.s.EI3: found -1, accepted: a number above zero"
    for name in ("nodes.B.position.1", "energy.elastic"):
        assert rows[1][name] == ""
        assert [float(rows[i][name]) for i in (0, 2, 3)] == found.table[name][[0, 2, 3]].tolist()


def test_json_and_npz_are_read_back_with_all_digits(found, tmp_path):
    found.save(tmp_path / "table.json")
    found.save(tmp_path / "table.npz")
    table = json.loads((tmp_path / "table.json").read_text())
    assert (table["cases"], table["solved"]) == (4, 3)
    columns = {name: np.array(column, dtype=found.table[name].dtype) for name, column in table["columns"].items()}
    with np.load(tmp_path / "table.npz") as arrays:
        assert list(arrays) == list(columns) == list(found.table)
        for name, column in found.table.items():
            numbers = column.dtype.kind == "f"
            assert np.array_equal(arrays[name], column, equal_nan=numbers)
            assert np.array_equal(columns[name], column, equal_nan=numbers)


def test_a_table_is_written_whole_or_not_at_all(found, tmp_path, monkeypatch):
    path = tmp_path / "table.csv"
    path.write_text("before")

    def full(*_):
        raise OSError("no space left")

    monkeypatch.setattr(csv, "writer", full)
    with pytest.raises(SceneError, match="could not be written: no space left"):
        found.save(path)
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda s: s.save("x.xls"), r"x.xls: found the ending '.xls', accepted: .csv, .json, .npz"),
        (lambda s: s.values("nodes.B.positoin"), r"did you mean 'nodes.B.position'"),
        (lambda s: s.mean("status"), r"found the column 'status', accepted: one of numbers"),
        (lambda s: s.quantiles(TIP, 1.5), r"probabilities: found \[1.5\], accepted: from 0 to 1"),
    ],
)
def test_what_a_result_refuses(found, call, sentence):
    with pytest.raises(SceneError, match=sentence):
        call(found)


# -- bad input --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cases", "sentence"),
    [
        ({}, "cases: found {}, accepted: a table of at least one named column"),
        ([1.0], "cases: found [1.0], accepted: a table of at least one named column"),
        ({"factor": []}, "cases.factor: found [], accepted: a list of finite numbers"),
        ({"factor": 2.0}, "cases.factor: found 2.0, accepted: a list of finite numbers"),
        ({"factor": ["1"]}, "cases.factor: found ['1'], accepted: a list of finite numbers"),
        ({"factor": [lambda: 1]}, "accepted: a list of finite numbers"),
        ({"factor": [True]}, "cases.factor: found [True], accepted: a list of finite numbers"),
        ({"factor": [[1], [1, 2]]}, "accepted: a list of finite numbers, or of lists of as many"),
        ({"factor": [1, np.inf]}, "cases.factor: found inf in case 1, accepted: finite numbers"),
        ({3: [1]}, "cases: found 3, accepted: names of numbers"),
        (
            {"factor": [1, 2], "loads.tip.value.1": [1, 2, 3]},
            "cases: found 3 in loads.tip.value.1 and 2 in factor, accepted: columns of the same length",
        ),
        ({"sections.s.EI33": [1]}, "did you mean 'EI3'?"),
        ({"loads.tpi.value": [[1, 2]]}, "found 'tpi', accepted: tip; did you mean 'tip'?"),
        ({"loads.tip.type": [1]}, "accepted: a number of the scene"),
        ({"loads.tip.value": [1.0]}, "found 1 number a case, accepted: 2, loads.tip.value.0, loads.tip.value.1"),
        (
            {"loads.tip.value": [[1, 2]], "loads.tip.value.0": [1]},
            "found loads.tip.value.0 more than once, accepted: each number once",
        ),
    ],
)
def test_bad_cases_are_refused_in_a_sentence(cases, sentence):
    with pytest.raises(SceneError) as error:
        here(SCENE, cases)
    assert sentence in str(error.value)


@pytest.mark.parametrize(
    ("quantities", "sentence"),
    [
        ([], "quantities: found [], accepted: a list of names"),
        (TIP, "quantities: found 'nodes.B.position', accepted: a list of names"),
        ([TIP, TIP], "found 'nodes.B.position' twice, accepted: each once"),
        ([3], "quantities: found 3, accepted: a name, as 'nodes.tip.position'"),
        (["nodes.C.position"], "quantities.nodes.C.position: found 'C', accepted: A, B"),
        (["nodes.B.positions"], "did you mean 'position'?"),
        (["node.B.position"], "did you mean 'nodes'?"),
        (["nodes.B"], "found 'nodes.B', accepted: nodes.NAME.KEY"),
        (["members.m.moment"], "found none, accepted: a place, as members.beam.moment at 0.5"),
        (["members.m.moment at half"], "found 'members.m.moment at half', accepted: a number after 'at'"),
        (["members.m.moment at 1.5"], "found 1.5, accepted: a fraction of the length"),
        (["nodes.B.position at 0.5"], "found 0.5, accepted: a place along members only"),
        (["nodes.B.position step 2"], "found 2"),
        (["nodes.B.position time 1"], "found the analysis 'static', accepted: 'dynamic' with this key"),
        (["reactions.B.force"], "node 'B' is free: no ground acts on it"),
        (
            ["energy.kinetic"],
            "'energy.kinetic', told of motion, steps only, accepted of statics: energy.elastic, energy.dissipated",
        ),
        (["certificate.stable"], "found 'certificate.stable', accepted: a quantity made of numbers"),
    ],
)
def test_bad_quantities_are_refused_in_a_sentence(quantities, sentence):
    with pytest.raises(SceneError) as error:
        here(SCENE, {"loads.tip.value.1": [1.0]}, quantities)
    assert str(error.value).startswith("quantities")
    assert sentence in str(error.value)


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ({"executor": "dask"}, "executor: found 'dask', accepted: a concurrent.futures.Executor"),
        ({"executor": Here(), "workers": 2}, "executor: found an executor and a number of workers"),
        ({"workers": 0}, "workers: found 0, accepted: a number of processes from 1"),
        ({"executor": Here(), "chunk": 0}, "chunk: found 0, accepted: a number of cases from 1"),
    ],
)
def test_bad_ways_to_run_are_refused_in_a_sentence(more, sentence):
    with pytest.raises(SceneError) as error:
        sweep(SCENE, FORCES, [TIP], **more)
    assert sentence in str(error.value)


def test_a_factor_and_steps_of_answers_contradict_each_other():
    with pytest.raises(SceneError, match="found 'step' where the cases say the factor"):
        here(SCENE, {"factor": [1.0, 2.0]}, [f"{TIP} step 1"])


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: Normal(1.0, 0.0), "deviation: found 0, accepted: a number above zero"),
        (lambda: LogNormal(-1.0, 0.1), "mean: found -1, accepted: a number above zero"),
        (lambda: Uniform(2.0, 1.0), "found 2 to 1, accepted: a range from low to high"),
        (lambda: Uniform(0.0, "1"), "high: found '1', accepted: a finite number"),
        (lambda: sampled(0, DRAWN), "count: found 0, accepted: a number of cases from 1"),
        (lambda: sampled(3, {}), "cases: found {}, accepted: a table of at least one distribution"),
        (lambda: sampled(3, {"a": 1.0}), "cases.a: found 1.0, accepted: Normal(mean, deviation)"),
        (lambda: sampled(3, DRAWN, seed=-1), "seed: found -1, accepted: a whole number from 0"),
        (lambda: sampled(3, DRAWN, method="sobol"), "method: found 'sobol', accepted: 'random' or 'latin'"),
        (lambda: grid({name: np.arange(1000.0) for name in "abc"}), "found 1e+09 combinations, accepted: 10000000"),
        (lambda: grid({}), "accepted: a table of at least one named column"),
        (lambda: Cases({}), "accepted: a table of at least one named column"),
    ],
)
def test_bad_samples_are_refused_in_a_sentence(call, sentence):
    with pytest.raises(SceneError) as error:
        call()
    assert sentence in str(error.value)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        (None, "there is no such file, accepted: a CSV table"),
        ("", "found 0 lines, accepted: a line of names and a line of numbers for each case"),
        ("a,b\n", "found 1 line"),
        ("0,1\n1,2\n", "found the numbers 0, 1 in the first line, accepted: names there"),
        ("a,a\n1,2\n", "found a name twice in the first line"),
        ("a,b\n1,2\n3\n", "found 1 cell in case 2 and 2 in the first line"),
        ("a,b\n1,x\n", "case 1.b: found 'x', accepted: a number"),
        ("a,b\n1,\n", "case 1.b: found '', accepted: a number"),
        ("a,b\n1,nan\n", "found nan in case 0, accepted: finite numbers"),
    ],
)
def test_bad_tables_are_refused_in_a_sentence(text, sentence, tmp_path):
    path = tmp_path / "cases.csv"
    if text is not None:
        path.write_text(text)
    with pytest.raises(SceneError) as error:
        read_cases(path)
    assert str(error.value).startswith(str(path))
    assert sentence in str(error.value)


def test_a_script_that_starts_processes_while_it_is_imported_is_told_so(tmp_path):
    script = tmp_path / "script.py"
    script.write_text("from sfetcas.sweeps.workers import Workers\nWorkers(1)\n")
    run = subprocess.run([sys.executable, script], capture_output=True, text=True)
    assert "accepted: a call below if __name__ == '__main__': in a script that can be imported" in run.stderr


def test_processes_end_with_the_one_that_started_them(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import os\nfrom sfetcas.sweeps.workers import Workers\n"
        "if __name__ == '__main__':\n    print(Workers(1).submit(os.getpid).result(), flush=True)\n    os._exit(1)\n"
    )
    # This ends when all processes that may write to the output did.
    run = subprocess.run([sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, timeout=30)
    assert int(run.stdout) > 0


def test_workers_take_any_work():
    with Workers(1) as workers:
        assert list(workers.map(abs, [-1, 2])) == [1, 2]


# -- the command ------------------------------------------------------------------------------------------


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "scene.toml"
    dump(SCENE.replace(title="bar"), path)
    return path


def test_command_solves_all_combinations_and_writes_tables(file, tmp_path, capsys):
    out = tmp_path / "table.csv"
    vary = ["--vary", "loads.tip.value.1=1:2:2", "--vary", "sections.s.EI3=1,3"]
    command = ["sweep", str(file), *vary, "--quantity", ROOT, "--quantity", TIP, "--workers", "1", "--out", str(out)]
    assert main(command) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[1] == "  4 cases of loads.tip.value.1, sections.s.EI3: 4 solved"
    with open(out, newline="") as table:
        rows = list(csv.DictReader(table))
    single = solve(changed(load(file), {"loads.tip.value.1": 2.0, "sections.s.EI3": 1.0})).last
    assert float(rows[2]["nodes.B.position.1"]) == single.position("B")[1]
    largest = next(line for line in printed if line.strip().startswith("nodes.B.position.1")).split()[5]
    assert float(largest) == pytest.approx(single.position("B")[1], rel=1e-8)  # printed with nine digits


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (["--vary", "sections.s.EI3=1,-1"], 1, "case 1 (sections.s.EI3 = -1): refused: sections.s.EI3: found -1"),
        (["--vary", "sections.s.EI3=-1"], 3, "sfetcas: no solution: none of 1 case was solved"),
        (["--vary", "sections.s.EI9=1"], 2, "scene.toml: cases.sections.s.EI9:"),
        (["--vary", "x"], 2, "--vary: found 'x', accepted: NAME=LOW:HIGH:COUNT or NAME=VALUE,VALUE,..."),
        (["--vary", "a=1:1:5"], 2, "accepted: 1 to 10000000 values between two bounds that differ"),
        (["--vary", "a=1", "--vary", "a=2"], 2, "--vary: found a twice, accepted: each number once"),
        (["--sample", "a=normal:1"], 2, "--sample: found 'a=normal:1', accepted: NAME=normal:MEAN:DEVIATION"),
        (["--sample", "a=uniform:2:1"], 2, "found 2 to 1, accepted: a range from low to high"),
        ([], 2, "found none or more than one of --vary, --sample and --cases, accepted: one of them"),
        (["--vary", "factor=1", "--out", "x.xls"], 2, "x.xls: found the ending '.xls', accepted: .csv, .json, .npz"),
    ],
)
def test_exit_codes_of_the_command(file, words, code, told, capsys):
    assert main(["sweep", str(file), *words, "--workers", "1"]) == code
    printed = capsys.readouterr()
    assert told in printed.out + printed.err


def test_command_takes_samples_and_tables(file, tmp_path, capsys):
    samples = ["--sample", "sections.s.EI3=lognormal:2:0.1", "--count", "2", "--seed", "5", "--latin"]
    assert main(["sweep", str(file), *samples, "--workers", "1", "--out", str(tmp_path / "a.npz")]) == 0
    drawn = sampled(2, {"sections.s.EI3": LogNormal(2.0, 0.1)}, seed=5, method="latin").columns["sections.s.EI3"]
    with np.load(tmp_path / "a.npz") as table:
        assert np.array_equal(table["sections.s.EI3"], drawn)
    cases = tmp_path / "cases.csv"
    cases.write_text("sections.s.EI3\n2\n")
    assert main(["sweep", str(file), "--cases", str(cases), "--workers", "1"]) == 0
    assert main(["sweep", str(file), "--cases", str(cases), "--out", str(cases)]) == 2
    assert "is what is read, accepted: another file" in capsys.readouterr().err
