# SPDX-License-Identifier: Apache-2.0
"""Drives a port with the chip's bus rule: request and inputs held until ready, data valid with ready."""
from cocotb.triggers import FallingEdge, RisingEdge


class Port:
    """One port of a dut: signals <prefix>_req_i, _we_i, _be_i, _addr_i, _wdata_i, _rdata_o, _ready_o."""

    def __init__(self, dut, prefix, clock):
        self.clock = clock
        self.rdata, self.ready = getattr(dut, f"{prefix}_rdata_o"), getattr(dut, f"{prefix}_ready_o")
        self.req, self.we, self.be, self.addr, self.wdata = (
            getattr(dut, f"{prefix}_{name}_i") for name in ("req", "we", "be", "addr", "wdata"))
        for pin in (self.req, self.we, self.be, self.addr, self.wdata):
            pin.value = 0

    async def access(self, word, we=0, be=15, wdata=0, more=False):
        """One access; begins in the present clock (call after a rising edge), returns (data, clocks until ready).

        more: the next access follows without a clock between, so the request line stays high.
        """
        self.req.value, self.we.value, self.be.value, self.addr.value, self.wdata.value = 1, we, be, word, wdata
        clocks = 0
        while True:
            await FallingEdge(self.clock)
            if int(self.ready.value):
                break
            clocks += 1
            assert clocks < 100, "the port hangs"
            await RisingEdge(self.clock)
        data = int(self.rdata.value) if not we else None
        self.done()
        await RisingEdge(self.clock)
        if not more:
            self.req.value = 0
        return data, clocks

    def done(self):
        """Called in the clock of ready, before the next rising edge: a place for a scoreboard."""
