# SPDX-License-Identifier: Apache-2.0
"""The cocotb side: binds a Line to the line pins of a DUT, and drives the native host port.

Nothing here runs per clock: one wake-up per edge of tx_man_o, one per start and end of a pulse, one per decision of
the slaves. Times of the line are ns since the pins were coupled; fractions come from clocks whose period is not whole.
"""
import cocotb
from asi import regmap
from asi.monitor import Monitor
from asi.window import COUNTERS, State
from cocotb.triggers import Event, FallingEdge, RisingEdge, Timer
from cocotb.utils import get_sim_time

from .line import Line
from .slaves import SlaveNetwork

MASTER = "master"
MAGIC = 0x4D49_5341             # 'ASIM'
PS = 1_000
SKEW_PS = 1                     # pins change this much after the instant of the line


class LinePins:
    """Couples tx_man_o, tx_en_o, rx_p_i, rx_n_i of a DUT with a Line, own pulses included, as on a real line.

    A falling edge of tx_man_o while tx_en_o is a negative pulse, a rising edge a positive one. A pulse on a clock
    edge comes just after it, as the chip's own outputs do, whoever makes the clock: then gaps are exact, not one short.
    """

    def __init__(self, dut, line=None, sender=MASTER):
        self.dut, self.line, self.sender = dut, line or Line(), sender
        self._origin_ps = int(get_sim_time("ps"))   # cocotb leaves a ps between tests: start a grid of our own
        self._pins = {-1: dut.rx_n_i, 1: dut.rx_p_i}
        self._last = {-1: -1, 1: -1}        # end of the pulse that is on the pin
        for pin in self._pins.values():
            pin.value = 0
        self.line.on_earlier = self._earlier
        self.line.listen(self._show)
        self._work = Event()
        self._target = None                 # time the pump sleeps until
        self._pump_task = cocotb.start_soon(self._pump())
        cocotb.start_soon(self._transmit())

    def _now_ps(self):
        return int(get_sim_time("ps")) - self._origin_ps

    def now(self):
        """Time of the line in ns; a float only when it is not whole."""
        whole, rest = divmod(self._now_ps(), PS)
        return whole + rest / PS if rest else whole

    async def _transmit(self):
        man, enable, line = self.dut.tx_man_o, self.dut.tx_en_o, self.line
        while True:
            await man.value_change
            if int(enable.value):
                now = self.now()
                line.pulse(now, 1 if int(man.value) else -1, self.sender)
                line.advance(now)

    async def _pump(self):
        line = self.line
        while True:
            while line.next_ns is not None:
                self._target = line.next_ns
                if (wait_ps := round(self._target * PS) + SKEW_PS - self._now_ps()) > 0:
                    await Timer(wait_ps, "ps")
                target, self._target = self._target, None   # on_earlier needs nothing while the queue is being run
                line.advance(target)
            self._work.clear()
            self._target = float("inf")
            await self._work.wait()

    def _earlier(self, t_ns):
        if self._target is None:
            return
        if self._target == float("inf"):
            self._work.set()
        elif t_ns < self._target:
            self._pump_task.cancel()
            self._pump_task = cocotb.start_soon(self._pump())
        else:
            return          # the queue was run by _transmit meanwhile: the pump wakes early enough
        self._target = None

    def _show(self, pulse):
        self._pins[pulse.polarity].value = 1
        self.line.at(pulse.t_ns + pulse.width_ns, self._hide, pulse.polarity)

    def _hide(self, polarity):
        end = self.line.busy_until[polarity]
        if end > self.line.now:             # a second sender made it longer
            self.line.at(end, self._hide, polarity)
        else:
            self._pins[polarity].value = 0


class HostPort:
    """Bus cycles on the native host port. Inputs change after a rising clock edge, ready is sampled before the next."""

    def __init__(self, dut):
        self.dut = dut
        dut.host_req_i.value = 0
        dut.host_we_i.value = 0
        dut.host_addr_i.value = 0
        dut.host_be_i.value = 0
        dut.host_wdata_i.value = 0

    async def _cycle(self, address, write, data=0, enable=0):
        dut = self.dut
        if not 0 <= address < 1 << 14:
            raise ValueError(f"address {address:#x} is not in the 16 KB window")
        await RisingEdge(dut.clk_i)
        dut.host_req_i.value = 1
        dut.host_we_i.value = write
        dut.host_addr_i.value = address >> 2
        dut.host_wdata_i.value = data
        dut.host_be_i.value = enable
        await FallingEdge(dut.clk_i)
        while not int(dut.host_ready_o.value):
            await FallingEdge(dut.clk_i)
        word = int(dut.host_rdata_o.value) if not write else 0
        await RisingEdge(dut.clk_i)
        dut.host_req_i.value = 0
        return word

    async def read(self, address, size=4):
        """size bytes (1, 2 or 4) at a byte address, little endian; ValueError when it is not aligned."""
        shift = self._check(address, size)
        return await self._cycle(address, 0, enable=15) >> shift & (1 << 8 * size) - 1

    async def write(self, address, value, size=4):
        """Write size bytes (1, 2 or 4); the neighbours keep their values."""
        shift = self._check(address, size)
        mask = (1 << 8 * size) - 1
        await self._cycle(address, 1, (value & mask) << shift, (1 << size) - 1 << (address & 3))

    @staticmethod
    def _check(address, size):
        if size not in (1, 2, 4) or address % size:
            raise ValueError(f"{size} bytes at {address:#x}")
        return 8 * (address & 3)


class HostWindow:
    """Named access to the host window; names are those of rdl/asi.rdl without the prefix (LDS, HOST_CTRL, CDI ...)."""

    FLAGS = [name[6:-4].lower() for name in dir(regmap) if name.startswith("FLAGS_") and name.endswith("_LSB")]
    SIZES = {"CDI": 2, "PCD": 2, "PP": 1, "PI": 1, "PECHO": 1}     # bytes per element, 4 else

    def __init__(self, port):
        self.port = port

    async def read(self, name, k=0):
        """Element k of a register array (k = 0: the register itself)."""
        size = self.SIZES.get(name, 4)
        return await self.port.read(getattr(regmap, f"HOST_{name}") + size * k, size)

    async def write(self, name, value, k=0):
        size = self.SIZES.get(name, 4)
        await self.port.write(getattr(regmap, f"HOST_{name}") + size * k, value, size)

    async def ready(self):
        """True once the firmware has written MAGIC (HW-001)."""
        return await self.read("MAGIC") == MAGIC

    async def indices(self, name):
        """A bit list (LDS, LAS, LPS, LPF, LPS_CFG) as a set of indices."""
        bits = await self.read(name) | await self.read(name, 1) << 32
        return {index for index in range(64) if bits >> index & 1}

    async def write_indices(self, name, indices):
        bits = sum(1 << index for index in indices)
        await self.write(name, bits & 0xFFFF_FFFF)
        await self.write(name, bits >> 32, 1)

    async def flags(self):
        """FLAGS as a set of the names that are 1."""
        word = await self.read("FLAGS")
        return {name for name in self.FLAGS if word >> getattr(regmap, f"FLAGS_{name.upper()}_LSB") & 1}

    async def state(self):
        """Flags, phase, lists and counters as asi.window.State."""
        set_flags = await self.flags()
        lists = [frozenset(await self.indices(name)) for name in ("LDS", "LAS", "LPS", "LPF")]
        return State({name: name in set_flags for name in self.FLAGS}, regmap.Phase(await self.read("PHASE")), *lists,
                     {name: await self.read(name.upper()) for name in COUNTERS})

    async def inputs(self, tries=50):
        """The 64 input nibbles of one cycle; AssertionError when IN_SEQ never holds still (HW-003)."""
        for _ in range(tries):
            before = await self.read("IN_SEQ")
            words = [await self.read("IN_IMG", k) for k in range(8)]
            if not before & 1 and await self.read("IN_SEQ") == before:
                return [words[index // 8] >> 4 * (index % 8) & 15 for index in range(64)]
        raise AssertionError("the input image never holds still")

    async def set_output(self, index, nibble):
        """One output nibble at host level."""
        address, half = divmod(index, 2)
        address += regmap.HOST_OUT_IMG
        byte = await self.port.read(address, 1)
        await self.port.write(address, byte & (0xF0 >> 4 * half) | nibble << 4 * half, 1)

    async def control(self, **bits):
        """Change bits of HOST_CTRL (protected_mode=1, ...) without a commit."""
        word = await self.read("HOST_CTRL")
        for name, on in bits.items():
            bit = 1 << getattr(regmap, f"HOST_CTRL_{name.upper()}_LSB")
            word = word | bit if on else word & ~bit
        await self.write("HOST_CTRL", word)

    async def project(self, codes, parameters=None):
        """LPS_CFG and PCD from {index: code word as in CDI}, PP from {index: nibble}; without a commit."""
        await self.write_indices("LPS_CFG", codes)
        for index, word in codes.items():
            await self.write("PCD", word, index)
        for index, nibble in (parameters or {}).items():
            await self.write("PP", nibble, index)

    async def start_commit(self):
        """HOST_SEQ + 1; returns it without waiting."""
        sequence = await self.read("HOST_SEQ") + 1 & 0xFFFF_FFFF
        await self.write("HOST_SEQ", sequence)
        return sequence

    async def commit(self, timeout_us=20_000):
        """Commit and wait for the answer of the firmware -> FW_RESULT; AssertionError when it does not come."""
        sequence = await self.start_commit()
        await self.until(lambda: self._applied(sequence), timeout_us, "commit", step_us=50)
        return await self.read("FW_RESULT")

    async def _applied(self, sequence):
        return await self.read("FW_SEQ") == sequence

    async def until(self, condition, timeout_us, what="condition", step_us=500):
        """Look at await condition() every step_us until it holds; AssertionError after timeout_us of bus time."""
        end = get_sim_time("us") + timeout_us
        while not await condition():
            assert get_sim_time("us") < end, f"{what}: not within {timeout_us} us"
            await Timer(step_us, "us")


class Chip:
    """asi_master on a line with slaves, a monitor and the host port. The clock comes from the SystemVerilog bench."""

    def __init__(self, dut, slaves=(), seed=0):
        self.dut = dut
        self.pins = LinePins(dut)
        self.line = self.pins.line
        self.monitor = Monitor(self.line, phase=lambda: int(dut.phase_o.value))
        self.net = SlaveNetwork(self.line, slaves, seed)
        self.port = HostPort(dut)
        self.host = HostWindow(self.port)
        dut.apf_ni.value = 1
        dut.efault_i.value = 0
        dut.spi_miso_i.value = 0

    async def pulse_reset(self, clocks=4):
        """Reset for some clocks."""
        self.dut.rst_i.value = 1
        for _ in range(clocks):
            await RisingEdge(self.dut.clk_i)
        self.dut.rst_i.value = 0

    async def reset(self):
        """Reset, then wait for the firmware to show itself (at most 50 ms). Reset clears MAGIC."""
        await self.pulse_reset()
        await self.host.until(self.host.ready, 50_000, "MAGIC")

    def supply(self, good):
        """Line voltage: pin apf_ni and the supply of the slaves."""
        self.line.advance(self.pins.now())
        self.dut.apf_ni.value = int(bool(good))
        self.net.power(good)

    def settle(self):
        """Bring monitor and slaves up to date; call it before looking at them."""
        self.line.advance(self.pins.now())
        self.net.settle()
        self.monitor.settle(self.line.now)

    def telegrams(self):
        """The records since the last call of this."""
        self.settle()
        out = list(self.monitor.telegrams)
        self.monitor.telegrams.clear()  # in place: the monitor appends to this list
        return out
