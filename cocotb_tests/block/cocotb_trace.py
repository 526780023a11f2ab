# SPDX-License-Identifier: Apache-2.0
import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge

from asi.regmap import ErrorClass, Phase
from asi.telegram import address_name, decode_call, encode_call


def text(signal, letters=14):
    return int(signal.value).to_bytes(letters, "big").decode("ascii").rstrip()


def expected(call, extended):
    """The request text by way of asi.telegram, which knows nothing of the module."""
    decoded, number = decode_call(call, lambda n: n in extended), call >> 5 & 31
    if decoded.name in ("BR01", "PRGM"):
        return f"{decoded.name} all"
    width = {"ADRA": 5, "WID1": 4, "DEXG": 3 if number in extended else 4,
             "WPAR": 3 if number in extended else 4}.get(decoded.name)
    data = "" if width is None or decoded.data is None else f"{decoded.data:0{width}b}"
    return f"{decoded.name:<4} {address_name(decoded.index, number in extended):<3} {data}".rstrip()


async def start(dut):
    Clock(dut.clk_i, 10, unit="ns").start()
    for name in ("req_i", "req_call_i", "res_i", "res_class_i", "res_data_i", "phase_i"):
        getattr(dut, name).value = 0
    dut.rst_i.value = 1
    await FallingEdge(dut.clk_i)
    await FallingEdge(dut.clk_i)
    dut.rst_i.value = 0


async def request(dut, call):
    dut.req_i.value, dut.req_call_i.value = 1, call
    await FallingEdge(dut.clk_i)
    dut.req_i.value = 0


async def result(dut, error, data=0):
    dut.res_i.value, dut.res_class_i.value, dut.res_data_i.value = 1, int(error), data
    await FallingEdge(dut.clk_i)
    dut.res_i.value = 0


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def every_call_reads_right(dut):
    """PL-003: the request text of all 2048 calls, before and after RDID has shown which numbers use A/B addressing."""
    await start(dut)
    for extended in (set(), {5, 17, 31}):
        for number in extended:
            await request(dut, encode_call("RDID", number))
            await result(dut, ErrorClass.OK, 0xA)
        last = text(dut.answer_text_o)
        for call in range(2048):
            await request(dut, call)
            assert text(dut.request_text_o) == expected(call, extended), f"{call:011b}"
            assert text(dut.answer_text_o) == last  # stays readable until the next result
    await request(dut, encode_call("RDID", 5))  # a standard slave has taken the place
    await result(dut, ErrorClass.OK, 0x0)
    await request(dut, encode_call("DEXG", 5, 0b0101))
    assert text(dut.request_text_o) == "DEXG 5   0101"


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def answers_and_phases_read_right(dut):
    """PL-003: the answer text is the nibble or the class, the phase text the phase; a broadcast has no answer."""
    await start(dut)
    for error in ErrorClass:
        for data in range(16):
            await request(dut, encode_call("RDIO", 9))
            await result(dut, error, data)
            assert text(dut.answer_text_o) == (f"{data:04b}" if error == ErrorClass.OK else error.name)
    await request(dut, encode_call("BR01"))
    await result(dut, ErrorClass.OK)
    assert text(dut.answer_text_o) == "none"
    for phase in Phase:
        dut.phase_i.value = int(phase)
        await FallingEdge(dut.clk_i)
        assert text(dut.phase_text_o) == phase.name


@cocotb.test(timeout_time=1, timeout_unit="ms")
async def last_data_per_slave(dut):
    """PL-003: a text per slave: the last DEXG data, the last valid answer, '!' when there was none; DEXG only."""
    await start(dut)
    texts = {index: "" for index in range(64) if index & 31}

    def check():
        for index, wanted in texts.items():
            array = dut.last_b if index & 32 else dut.last_a
            assert text(array[index & 31], 12) == wanted, index

    check()
    await request(dut, encode_call("RDID", 7))
    await result(dut, ErrorClass.OK, 0xA)
    story = (("DEXG", 3, 0b1010, ErrorClass.OK, 0b0110, "1010 -> 0110"),
             ("DEXG", 7 + 32, 0b101, ErrorClass.OK, 0b1001, "101  -> 1001"),
             ("DEXG", 7, 0b011, ErrorClass.OK, 0b0011, "011  -> 0011"),
             ("DEXG", 3, 0b0001, ErrorClass.PARITY, 0b1111, "0001 !> 0110"),
             ("WPAR", 3, 0b0111, ErrorClass.OK, 0b0111, "0001 !> 0110"),
             ("DEXG", 31, 0b1111, ErrorClass.NO_RESPONSE, 0, "1111 !>"),
             ("DEXG", 7 + 32, 0b000, ErrorClass.LENGTH, 0, "000  !> 1001"),
             ("DEXG", 3, 0b0001, ErrorClass.OK, 0b0000, "0001 -> 0000"))
    for name, index, data, error, answer, wanted in story:
        await request(dut, encode_call(name, index, data, extended=index & 31 == 7))
        check()                 # it changes with the answer, not before
        await result(dut, error, answer)
        texts[index] = wanted
        check()
