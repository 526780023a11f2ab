# SPDX-License-Identifier: Apache-2.0
"""The one place that knows how the device under test is asked: pins, handshake, class codes, abilities.

A device with another interface needs another adapter and another bench (tb_compliance.sv), nothing else.
"""
from dataclasses import dataclass

# error_class_e of this project -> names of the rules
_CLASSES = {0: "OK", 1: "NO_RESPONSE", 2: "START", 3: "ALTERNATION", 4: "TIMING", 5: "NO_INFORMATION", 6: "END_BIT",
            7: "PARITY", 8: "LENGTH", 9: "EARLY", 10: "BAD_MASTER", 15: "ABORTED"}


@dataclass(frozen=True)
class Result:
    last: str        # class of the last attempt
    first: str       # class of the first attempt
    data: int        # answer, when last is OK
    repeats: int


class AsiXact:
    """dut_asi in tb_compliance."""
    # what the suite may expect; a device without an ability is not asked the cases that need it
    #   read_back: the own request is read back; retries: immediate repetitions; abort: enable ends an open call;
    #   classes: every class has its own code (else any failed check counts as any other)
    abilities = frozenset({"read_back", "retries", "abort", "classes"})
    # clocks: how far a measured gap may be off, and how near to a limit a pulse may be without being told apart
    slack = 0

    def __init__(self, dut, hz: int):
        self.dut, self.hz = dut, hz
        self.rx = {1: dut.rx_p, -1: dut.rx_n}  # inputs of the device: pulses of slaves and disturbances
        self.man, self.en, self.stalled = dut.tx_man, dut.tx_en, dut.stalled
        self.result_signal = dut.res_number    # changes with each result
        self._go = int(dut.go.value)

    def inputs(self, **values):
        for name, value in values.items():
            getattr(self.dut, name).value = value

    def reset(self, on: int):
        self.inputs(rst=on)

    def enable(self, on: int):
        self.inputs(enable=on)

    def echo(self, delay: int | None):
        """Own pulses come back on the rx pins after so many clocks; None: they do not."""
        self.inputs(echo_on=int(delay is not None), echo_delay=delay or 0)

    def mutant(self, number: int):
        self.inputs(mutant=number)

    def offer(self, call: int, retries: int, no_reply: bool):
        """Offer a request; it stays offered until the device takes it."""
        self._go ^= 1
        self.inputs(call=call, retries=retries, no_reply=int(no_reply), go=self._go)

    def result(self) -> Result:
        dut = self.dut
        codes = int(dut.res_last.value), int(dut.res_first.value)
        names = [_CLASSES.get(code, f"code {code}") for code in codes]
        return Result(*names, int(dut.res_data.value), int(dut.res_repeats.value))
