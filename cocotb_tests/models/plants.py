# SPDX-License-Identifier: Apache-2.0
"""Plays a plant (asi.plant) on the RTL with the Python models (PL-004).

The player itself is asi.run.Runner, as for the native simulation: actions, host, functions and checks exist once. Here
is only what it needs of a simulation (asi.run.Bench), made of the Python line, slaves and monitor. The runner is plain
code, so it runs in a thread of cocotb's; time passes only inside its calls of run, host_read and host_write.
"""
from dataclasses import dataclass, replace
from pathlib import Path

import cocotb
from asi.plant import Faults as PlantFaults
from asi.plant import Plant
from asi.plant import Slave as PlantSlave
from asi.regmap import HOST_CLOCK_MHZ, Phase
from asi.run import Runner
from asi.telegram_log import TelegramLog
from cocotb.task import bridge, resume
from cocotb.triggers import RisingEdge, Timer

from .chip import Chip
from .faults import Faults
from .slaves import Slave

PER_ONE = 65_536                # unit of the probabilities in a plant
PS = 1_000


def make_slave(slave: PlantSlave) -> Slave:
    """A slave of a plant as a slave of the models."""
    codes, transaction = slave.codes, {}
    if any(slave.values):
        transaction["values"] = slave.values
    for name in ("invalid", "overflow", "strings"):
        if given := getattr(slave, name):
            transaction[name] = given
    if slave.safety is not None:
        transaction |= {"words": slave.safety.table, "closed": slave.safety.closed}
    return Slave(slave.index, codes.io, codes.id, codes.id1, codes.id2, slave.inputs, slave.watchdog, slave.present,
                 **vars(slave.options), **transaction)


def make_faults(value: PlantFaults) -> Faults:
    """asi.plant.Faults -> Faults of the models."""
    rate = {name: getattr(value, name) / PER_ONE
            for name in ("no_answer", "parity", "missing_pulse", "shifted_pulse", "extra_pulse")}
    return Faults(**rate, shift_ns=value.shift_ns, delay_ns=value.delay_ns)


@dataclass
class Stats:
    """Of sync_o. cycle_max_ns: longest period in one go of data exchange, 0: none yet."""
    cycles: int = 0
    cycle_max_ns: int = 0


class ModelBench:
    """asi.run.Bench on the RTL. Its methods block: call them inside cocotb.task.bridge only.

    Times count from the coupling of the line, a few clocks before the reset ends. A slave's handle is its position.
    """

    def __init__(self, dut, seed: int):
        self.chip = Chip(dut, (), seed)
        self.net = self.chip.net
        self._engines = []              # by slave: a slave whose memory is spoilt has none
        self._stats = Stats()
        self._sync_ns = None
        cocotb.start_soon(self._cycles())
        cocotb.start_soon(self._phases())

    async def _cycles(self):
        stats = self._stats
        while True:
            await RisingEdge(self.chip.dut.sync_o)
            now = self.chip.pins.now()
            stats.cycles += 1
            if self._sync_ns is not None:
                stats.cycle_max_ns = max(stats.cycle_max_ns, now - self._sync_ns)
            self._sync_ns = now

    async def _phases(self):
        phase = self.chip.dut.phase_o
        while True:
            await phase.value_change
            if int(phase.value) < Phase.DATA_EXCHANGE:
                self._sync_ns = None    # a start-up is not a cycle

    # ------------------------------------------------------------ time, host, line
    @property
    def clk_hz(self):
        return 1_000_000 * self.host_read(HOST_CLOCK_MHZ)

    def time(self):
        return int(self.chip.pins.now())

    def run(self, until_ns):
        @resume
        async def work():
            if (wait := until_ns - self.chip.pins.now()) > 0:
                await Timer(round(wait * PS), "ps")
            self.chip.settle()
        work()
        return self.time()

    def host_read(self, addr):
        return resume(self.chip.port.read)(addr)

    def host_write(self, addr, data, be=15):
        if be != 15:
            raise ValueError(f"byte enables {be:04b}: the window writes whole words")
        resume(self.chip.port.write)(addr, data)

    def telegrams(self):
        return [telegram if telegram.call is not None else replace(telegram, call=0)
                for telegram in self.chip.telegrams()]

    def stats(self):
        return self._stats

    # ------------------------------------------------------------ the world
    def _change(self, function):
        """function() in the simulator's own thread, with slaves and monitor up to date."""
        @resume
        async def work():
            self.chip.settle()
            return function()
        return work()

    def add(self, slave):
        made = make_slave(slave)
        self._engines.append(made.ctt)
        self._change(lambda: self.net.add(made))
        return len(self._engines) - 1

    def set_inputs(self, slave, nibble):
        self._change(lambda: setattr(self.net.slaves[slave], "inputs", nibble))

    def set_present(self, slave, present):
        self._change(lambda: self.net.set_present(self.net.slaves[slave], present))

    def set_periphery_fault(self, slave, fault):
        self._change(lambda: setattr(self.net.slaves[slave], "periphery_fault", fault))

    def set_faults(self, slave, faults):
        self._change(lambda: setattr(self.net.slaves[slave], "faults", make_faults(faults)))

    def set_value(self, slave, channel, word):
        self._change(lambda: self._engines[slave].values.__setitem__(channel, word))

    def get_value(self, slave, channel):
        return self._change(lambda: self._engines[slave].outputs[channel])

    def set_invalid(self, slave, invalid, overflow):
        self._change(lambda: vars(self._engines[slave]).update(invalid=invalid, overflow=overflow))

    def set_safety(self, slave, table, closed):
        self._change(lambda: vars(self._engines[slave]).update(words=table, closed=closed))

    def power(self, good):
        self._change(lambda: self.net.power(good))

    def apf(self, low):
        self._change(lambda: setattr(self.chip.dut.apf_ni, "value", int(not low)))


class Player:
    """A plant on a chip of its own."""

    def __init__(self, dut, plant: Plant):
        self.plant = plant
        self.bench = ModelBench(dut, plant.seed)
        self.chip = self.bench.chip
        self.runner = Runner(plant, self.bench, Path(), log=False, html=False)  # play() writes nothing
        self.log = TelegramLog(None, plant.extended)

    async def play(self):
        """Reset and the whole plant; AssertionError with every check and function that did not end as wanted."""
        await self.chip.pulse_reset()
        await bridge(self.runner.play)(self.log)
        bad = [f"{one['name']} at {one['at_ns'] / 1e6:g} ms {one['result']}: {'; '.join(one['differences'])}"
               for one in self.runner.results() if one["result"] != "met"]
        assert not bad, f"{self.plant.name}: {' | '.join(bad)}"
