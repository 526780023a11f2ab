# SPDX-License-Identifier: Apache-2.0
import cocotb
from asi import telegram
from cocotb.triggers import ValueChange
from cocotb_tests.block.phy_bench import now, start, to_clocks, until, wait, watch

# E1 .. E11: (name, call, request word, pulses of the example in us, sign = polarity)
EXAMPLES = (
    ("E1", telegram.encode_call("DEXG", 5, 0b1010), 0x02A9, "-0 +3 -6 +9 -12 +15 -18 +24 -30 +36 -42 +48 -54 +60 -66 "
     "+69 -72 +78"),
    ("E2", telegram.encode_call("DEXG", 5, 0b0101), 0x0295, "-0 +3 -6 +9 -12 +15 -18 +24 -30 +36 -42 +45 -48 +54 -60 "
     "+66 -72 +78"),
    ("E6", telegram.encode_call("WPAR", 12, 0b0110), 0x065B, "-0 +3 -6 +9 -12 +18 -21 +24 -30 +33 -36 +42 -48 +54 -57 "
     "+60 -66 +72 -75 +78"),
    ("E7", telegram.encode_call("ADRA", 0, 7), 0x001F, "-0 +3 -6 +9 -12 +15 -18 +21 -24 +27 -30 +33 -36 +39 -42 +45 "
     "-48 +54 -57 +60 -63 +66 -69 +72 -75 +78"),
    ("E8", telegram.encode_call("BR01"), 0x1FD7, "-.+-+-+-+-+-+-+.-.+.-.+-+-+"),
    ("E9A", telegram.encode_call("DEXG", 5, 0b101, True), 0x02B7, "-+-+-+-.+.-.+.-.+-+.-.+-+-+"),
    ("E9B", telegram.encode_call("DEXG", 37, 0b101, True), 0x0295, "-+-+-+-.+.-.+.-+-.+.-.+.-.+"),
    ("E10W", telegram.encode_call("WPAR", 5, 15), 0x02FF, None),
    ("E10D", telegram.encode_call("DEXG", 5, 15), 0x02BD, None),
    *((f"E11 {name} {index}", telegram.encode_call(name, index), word, None) for name, a, b in (
        ("DELA", 0x1283, 0x12A1), ("RES", 0x12F1, 0x12D3), ("RDIO", 0x12C1, 0x12E3), ("RDID", 0x12C7, 0x12E5),
        ("RID1", 0x12CB, 0x12E9), ("RID2", 0x12CD, 0x12EF), ("RDST", 0x12FB, 0x12D9))
      for index, word in ((5, a), (37, b))),
    ("E11 WID1 7", telegram.encode_call("WID1", 0, 7), 0x101D, None),
    ("E11 WID1 F", telegram.encode_call("WID1", 0, 15), 0x103F, None),
)


def train(text):
    """Pulse train of an example, as list or as one character per 3 us -> [(ns, polarity)]"""
    if " " in text:
        return [(int(p[1:]) * 1000, 1 if p[0] == "+" else -1) for p in text.split()]
    return [(k * 3000, 1 if c == "+" else -1) for k, c in enumerate(text) if c != "."]


async def begin(dut):
    await start(dut, start_i=0, arm_i=0, call_i=0)
    return int(dut.ClkHz.value)


async def send(dut, call):
    """-> clock in which start_i was high"""
    dut.start_i.value, dut.call_i.value = 1, call
    started = now()
    await wait(1)
    dut.start_i.value, dut.call_i.value = 0, 0
    return started


def edges(signal):
    """-> growing list of (clock, level) of a registered output"""
    seen = []

    async def run():
        while True:
            await ValueChange(signal)
            seen.append((now(), int(signal.value)))
    cocotb.start_soon(run())
    return seen


@cocotb.test(timeout_time=2, timeout_unit="ms")
async def examples(dut):
    """TL-001, TL-004, TL-005, TL-006, LT-001: E1, E2, E6 .. E11 leave the transmitter edge by edge, exact to the
    clock."""
    hz = await begin(dut)
    man, enable, last = edges(dut.tx_man_o), edges(dut.tx_en_o), watch(dut.last_o)
    for name, call, word, text in EXAMPLES:
        expected = telegram.request_pulses(call)
        assert telegram.request_word(call) == word, name
        assert text is None or train(text) == expected, name
        for seen in (man, enable, last):
            seen.clear()
        started = await send(dut, call)
        assert dut.busy_o.value == 1, name
        first = started + 1
        await until(first + 81 * hz // 10**6 - 1)
        assert dut.busy_o.value == 1, name
        await wait(1)
        assert dut.busy_o.value == 0, name
        assert man == [(first + t, int(p > 0)) for t, p in to_clocks(expected, hz)], name
        assert enable == [(first, 1), (first + 81 * hz // 10**6, 0)], name
        assert last == [(first + 78 * hz // 10**6,)], name


@cocotb.test(timeout_time=100, timeout_unit="ms")
async def all_calls(dut):
    """TL-001, TL-003, TL-004, TL-005: all 2048 calls, MAN sampled in every half bit, back to back."""
    hz = await begin(dut)
    half = 3 * hz // 10**6
    for call in range(0, 2048, 1 if hz < 48 * 10**6 else 13):  # the highest clock only adds time
        levels = []
        first = await send(dut, call) + 1
        await until(first + half // 2)
        for _ in range(27):
            levels.append(int(dut.tx_man_o.value))
            await wait(half)
        word = telegram.request_word(call)
        bits = [word >> (13 - k) & 1 for k in range(14)]
        halves = [level for bit in bits for level in (1 - bit, bit)][1:]  # the start bit begins with the idle level
        assert levels == halves, f"call {call:#x}"
        pulses = [(k * 3000, 1 if level else -1) for k, level in enumerate(levels) if level != ([1] + levels)[k]]
        assert pulses == telegram.request_pulses(call), f"call {call:#x}"


@cocotb.test(timeout_time=100, timeout_unit="us")
async def arm(dut):
    """LT-009: tx_en rises one clock after arm_i, stays through the request without a gap and falls 81 us after its
    start."""
    hz = await begin(dut)
    enable, man = edges(dut.tx_en_o), edges(dut.tx_man_o)
    dut.arm_i.value = 1
    armed = now()
    await wait(12 * hz // 10**6)
    first = await send(dut, 0x155) + 1
    dut.arm_i.value = 0
    await wait(90 * hz // 10**6)
    assert man[0] == (first, 0) and first - armed - 1 == 12 * hz // 10**6
    assert enable == [(armed + 1, 1), (first + 81 * hz // 10**6, 0)]


@cocotb.test(timeout_time=100, timeout_unit="us")
async def disarm(dut):
    """LT-009: an arm that is withdrawn takes tx_en down again and leaves MAN alone."""
    await begin(dut)
    enable, man = edges(dut.tx_en_o), edges(dut.tx_man_o)
    dut.arm_i.value = 1
    armed = now()
    await wait(5)
    dut.arm_i.value = 0
    await wait(5)
    assert enable == [(armed + 1, 1), (armed + 6, 0)] and man == []


@cocotb.test(timeout_time=100, timeout_unit="us")
async def reset(dut):
    """TL-004: reset in a request brings MAN to its idle level and tx_en down."""
    hz = await begin(dut)
    await send(dut, 0)
    await wait(10 * hz // 10**6)
    assert dut.tx_en_o.value == 1
    dut.rst_i.value = 1
    await wait(1)
    assert (dut.tx_man_o.value, dut.tx_en_o.value, dut.busy_o.value) == (1, 0, 0)
