# SPDX-License-Identifier: Apache-2.0
"""Simulated slaves: one listener follows the requests on the line, the slaves they concern act and answer.

Independent of the native slaves (tb/) on purpose; SL-007 compares the two. Times in ns of bus time.
"""
from random import Random

from asi.checks import HALF_BIT_NS, QUIET_ASYNC_NS, QUIET_NS, REQUEST_BITS, RequestCollector, WIN_LATE_NS, end_ns

from . import ctt
from .faults import Faults

ANSWER_SYNC_NS = 21_500         # last request pulse to first answer pulse
ANSWER_ASYNC_NS = 33_500
PAUSE_NS = QUIET_ASYNC_NS       # quiet line after which a slave that lost the thread takes a pulse for a start
RESET_NS = 1_000_000            # silent after RES, BR01 or watchdog
POWER_UP_NS = 10_000_000        # silent after the supply came
WRITE_NS = 15_000_000           # non-volatile write of address or ID1, S0 = 1
WATCHDOG_NS = 94_200_000
NEVER = float("inf")

# D3..D0 that are outputs only: the answer repeats them. Tristate and bidirectional ports read the pin.
OUTPUT_ONLY = {0x0: 0b0000, 0x1: 0b1000, 0x2: 0b0000, 0x3: 0b1100, 0x4: 0b0000, 0x5: 0b1110, 0x6: 0b0000, 0x7: 0b0000,
               0x8: 0b1111, 0x9: 0b0111, 0xA: 0b0111, 0xB: 0b0011, 0xC: 0b0011, 0xD: 0b0001, 0xE: 0b0001, 0xF: 0b0000}

BR01_CALL = 1 << 10 | 31 << 5 | 0b10101
S0_WRITING, S1_PERIPHERY, S3_MEMORY = 1, 2, 8


class Slave:
    """One slave: registers, reset, watchdog, non-volatile memory. It knows no pulses, only calls and times.

    ctt: the engine of its combined transaction (models/ctt.py: values, outputs, strings ...), None for plain nibbles.
    The options of SL-010 may be changed at any time; they hold for the next call that asks for them.
    """

    def __init__(self, address, io=7, id=0xF, id1=0xF, id2=0xF, inputs=0, watchdog=False, present=True, faults=None, *,
                 write_ns=WRITE_NS, write_fails=False, id1_locked=False, old=False, sel_at_zero=False, **transaction):
        """address: index 0, 1..31, 33..63. A B index needs ID = A and sets ID1 bit 3; ValueError otherwise.

        write_ns: time of a memory write. write_fails: it ends with S3 = 1 and the old content; until a reset the new
        values hold. id1_locked: WID1 that changes the low three bits is not answered. old: RID1 and RID2 are not
        answered. sel_at_zero: at address 0 an A/B slave obeys the select of its ID1, else Sel = 0.
        transaction: options of ctt.make(), as values, strings.
        """
        number, sel = address & 31, address >> 5
        if not 0 <= address <= 63 or address == 32:
            raise ValueError(f"address index {address}")
        if sel and id != 0xA:
            raise ValueError(f"{number}B needs ID = A, not {id:X}")
        self.number, self.io, self.id, self.id1, self.id2 = number, io, id, id1, id2
        if self.extended and number:
            self.id1 = id1 & 7 | sel << 3
        self.inputs = inputs
        self.watchdog = watchdog
        self.plugged = present                      # on the cable
        self.present = False                        # ... and powered
        self.faults = faults or Faults()
        self.write_ns, self.write_fails, self.id1_locked = write_ns, write_fails, id1_locked
        self.old, self.sel_at_zero = old, sel_at_zero
        self.ctt = ctt.make(io, id, id2, **transaction)
        self.periphery_fault = False
        self.requests = self.answers = 0
        self._memory = (self.number, self.id1)      # non-volatile address and ID1
        self._memory_ok = self._write_good = True
        self._spoilt = None                         # (io, id, ctt) while a half written memory hides them
        self._writing_until = -1
        self._defaults(NEVER)

    # ------------------------------------------------------------------ what it shows
    @property
    def extended(self):
        """A/B addressing."""
        return self.id == 0xA

    @property
    def sel(self):
        """Select bit: ID1 bit 3 of an A/B slave."""
        return self.id1 >> 3 if self.extended else 0

    @property
    def address(self):
        """Address as index."""
        return self.number + 32 * self.sel if self.number else 0

    def status(self, t_ns):
        """S3..S0 at t_ns."""
        return (S0_WRITING * (t_ns < self._writing_until) | S1_PERIPHERY * self.periphery_fault
                | S3_MEMORY * (not self._memory_ok))

    # ------------------------------------------------------------------ reset, power, watchdog
    def _defaults(self, ready_ns):
        """Registers after any reset; the slave hears again from ready_ns on."""
        self.number, self.id1 = self._memory
        self.outputs = self.parameter = 0xF
        self.dexg_disabled = True
        self.synchronous = False
        self.ready_ns = self._served_ns = ready_ns
        if self.ctt:
            self.ctt.reset()

    def power_up(self, t_ns):
        """The supply comes (or the slave is plugged in)."""
        self.present = True
        self._defaults(t_ns + POWER_UP_NS)

    def power_down(self, t_ns):
        """The supply goes; a running memory write is spoilt, until another one goes well."""
        self.update(t_ns)
        if self.present and t_ns < self._writing_until:
            self._memory = (0, self._memory[1])
            self._memory_ok = False
            self._spoilt = self._spoilt or (self.io, self.id, self.ctt)
            self.io, self.id, self.ctt = 0xF, 0xF, None
        self._writing_until = -1
        self.present = False

    def update(self, t_ns):
        """Let time-outs up to t_ns happen."""
        if 0 <= self._writing_until <= t_ns:
            self._memory_ok = self._write_good      # S3 tells of the last write
            if self._memory_ok and self._spoilt:
                (self.io, self.id, self.ctt), self._spoilt = self._spoilt, None
                if self.ctt:
                    self.ctt.reset()
        if self.ctt and self.present:
            self.ctt.update(t_ns)
        while self.watchdog and self.number and self.present:
            expiry = max(self._served_ns + WATCHDOG_NS, self._writing_until)
            if t_ns < expiry:
                return
            self._defaults(expiry + RESET_NS)

    # ------------------------------------------------------------------ requests
    def hears(self, t_ns):
        """True when it listens at t_ns."""
        return self.present and t_ns >= self.ready_ns

    def request(self, call, t_ns):
        """A good request whose last pulse was at t_ns -> nibble of the answer, None for no answer."""
        control, number, info = call >> 10, call >> 5 & 31, call & 31
        if call == BR01_CALL:
            self._defaults(t_ns + RESET_NS)
            return None
        if number != self.number:
            return None
        if control:
            return self._write_id1(info & 15, t_ns) if number == 0 and not info & 16 else self._command(info, t_ns)
        return self._data(info, t_ns) if number else self._address(info, t_ns)

    def _data(self, info, t_ns):
        """DEXG and WPAR."""
        if self.extended:
            if (info >> 3 & 1) == self.sel:                             # I3 is ~Sel
                return None
            info |= 8                                                   # no fourth output or parameter: stays 1
        self.requests += 1
        if info & 16:
            self.parameter = info & 15
            self.dexg_disabled = False
            self._served_ns = t_ns
            return self.ctt.write_parameter(self.parameter, t_ns) if self.ctt else self.parameter
        if self.dexg_disabled:
            return None
        self.outputs = info & 15
        self._served_ns = t_ns
        echoed = OUTPUT_ONLY[self.io] & (7 if self.extended else 15)    # D3 of an A/B slave is an input
        return self.outputs & echoed | self._inputs(info, t_ns) & ~echoed & 15

    def _inputs(self, info, t_ns):
        """What a DEXG reads at the ports, or from the engine behind them."""
        if not self.ctt:
            return self.inputs
        self.ctt.inputs = self.inputs
        return self.ctt.exchange(info & (7 if self.extended else 15), t_ns)

    def _address(self, new, t_ns):
        """ADRA: the new address holds at once and is then written."""
        self.requests += 1
        self.number = new
        self._served_ns = t_ns                                          # the watchdog starts with the address
        self._write((new, self._memory[1]), t_ns)
        return 6

    def _write_id1(self, id1, t_ns):
        if self.id1_locked and (id1 ^ self.id1) & 7:
            return None
        self.requests += 1
        self.id1 = id1
        self._write((self._memory[0], id1), t_ns)                       # after DELA the old address is still stored
        return 0

    def _write(self, memory, t_ns):
        """Write the non-volatile memory."""
        self._write_good = not self.write_fails
        if self._write_good:
            self._memory = memory
        self._writing_until = t_ns + self.write_ns

    def _command(self, info, t_ns):
        """Commands with the select bit in I3, some of them inverted."""
        sel = self.sel if self.number or self.sel_at_zero else 0
        plain = info ^ sel << 3
        if self.old and plain in (0b10010, 0b10011):                    # RID1, RID2
            return None
        answer = {0b00000: 0, 0b11100: 6, 0b11110: self.status(t_ns),   # DELA, RES, RDST
                  0b10000: self.io, 0b10001: self.id, 0b10010: self.id1, 0b10011: self.id2}.get(plain)
        if answer is not None:
            self.requests += 1
        if plain == 0b00000:
            self.number = 0                                             # volatile: a reset brings the old one back
        elif plain == 0b11100:
            self._defaults(t_ns + RESET_NS)
        return answer


class SlaveNetwork:
    """All slaves of a line behind one listener. It hears everybody but its own slaves."""

    def __init__(self, line, slaves=(), seed=0):
        self.line = line
        self.slaves = []
        self.powered = True
        self._seed = seed
        self._random = {}
        self._request = None        # RequestCollector while a request is on the line
        self._sync_only = False     # it began too early for the asynchronous slaves
        self._tail = False          # good request, asynchronous slaves still want quiet
        self._lost = False          # bad request: wait for a pause
        self._last_ns = -NEVER
        for slave in slaves:
            self.add(slave)
        line.listen(self._pulse)

    def add(self, slave):
        """A new slave; if it is plugged in, its power-up begins now."""
        self._random[slave] = Random(f"{self._seed}/{len(self.slaves)}")    # a stream per slave
        self.slaves.append(slave)
        if slave.plugged and self.powered:
            slave.power_up(self.line.now)
        return slave

    def power(self, good):
        """Supply of the line."""
        self.settle()
        self.powered = bool(good)
        for slave in self.slaves:
            if slave.plugged and self.powered != slave.present:
                (slave.power_up if self.powered else slave.power_down)(self.line.now)

    def set_present(self, slave, present):
        """Plug in or unplug one slave; plugging in is a power-up."""
        self.settle()
        slave.plugged = bool(present)
        if slave.present and not present:
            slave.power_down(self.line.now)
        elif present and self.powered and not slave.present:
            slave.power_up(self.line.now)

    def settle(self):
        """Bring what a slave shows up to date with the line's time (resets by watchdog, broken-off requests)."""
        if self._request and not self._request.alive(self.line.now):
            self._bad()
        for slave in self.slaves:
            slave.update(self.line.now)

    # ------------------------------------------------------------------ listening
    def _pulse(self, pulse):
        if isinstance(pulse.sender, Slave):
            return
        now, polarity = pulse.t_ns, pulse.polarity
        quiet, self._last_ns = now - self._last_ns, now
        request = self._request
        if request and request.call is not None and not self._tail:     # the quiet bit time is broken
            self._bad()
        elif request and not self._tail:
            if not request.alive(now) or not request.add(now, polarity):
                self._bad()
                if quiet >= PAUSE_NS:
                    self._begin(now, polarity, sync_only=False)
            elif request.call is not None:
                quiet_end = request.t0 + end_ns(REQUEST_BITS) + QUIET_NS + WIN_LATE_NS
                self.line.at(quiet_end, self._good, request, now)
        elif self._lost and quiet < PAUSE_NS:
            pass
        else:
            # a pulse in the tail: a new request for the synchronous slaves, noise for the others
            self._begin(now, polarity, sync_only=self._tail or (self._sync_only and quiet < PAUSE_NS))

    def _begin(self, t_ns, polarity, sync_only):
        self._request, self._sync_only = RequestCollector(t_ns, polarity), sync_only
        self._tail = self._lost = False
        if polarity > 0:
            self._bad()

    def _bad(self):
        """Every slave that listens drops the request and becomes asynchronous (SL-003)."""
        self._request, self._tail, self._lost = None, False, True
        for slave in self.slaves:
            slave.update(self.line.now)
            if slave.hears(self.line.now):
                slave.synchronous = False

    def _good(self, request, last_ns):
        """The synchronous slaves have seen enough quiet; the others want QUIET_ASYNC_NS."""
        if request is not self._request:
            return
        if self._sync_only:
            self._request = None
        else:
            self._tail = True
            self.line.at(request.t0 + end_ns(REQUEST_BITS) + QUIET_ASYNC_NS + WIN_LATE_NS, self._good_async, request,
                         last_ns, [s for s in self.slaves if not s.synchronous])
        self._dispatch(request, last_ns, [s for s in self.slaves if s.synchronous], ANSWER_SYNC_NS)

    def _good_async(self, request, last_ns, slaves):
        if request is not self._request:
            return
        self._request, self._tail = None, False
        self._dispatch(request, last_ns, slaves, ANSWER_ASYNC_NS)

    def _dispatch(self, request, last_ns, slaves, delay_ns):
        for slave in slaves:
            slave.update(self.line.now)
            if not slave.hears(request.t0):
                continue
            slave.synchronous = True
            nibble = slave.request(request.call, last_ns)
            if nibble is not None:
                self._answer(slave, nibble, last_ns + delay_ns)

    def _answer(self, slave, nibble, start_ns):
        pulses = slave.faults.answer(nibble, self._random[slave])
        slave.answers += bool(pulses)
        for offset, polarity in pulses:
            self.line.pulse(start_ns + offset, polarity, slave)
