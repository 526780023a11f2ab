# SPDX-License-Identifier: Apache-2.0
"""Plays cases on a device through its adapter and compares what it does with what the oracle says.

Cases of one run follow each other without a pause: the next request is offered when the result of the present call
comes, so each gap is measured on the way. After a failed case the device is reset. Checked for every case: class of
first and last attempt, data, number of repetitions, one result at the right time; for every request: each edge of
tx_man, tx_en before, during and after it, and the gap before it, all to the clock.
"""
from dataclasses import dataclass, field

import cocotb
from cocotb.triggers import Event, Timer, ValueChange
from cocotb.utils import get_sim_time

from cocotb_tests.compliance.cases import Case, Step
from cocotb_tests.compliance.oracle import ABORTED, OK, Outcome, Times, request_word, train

_CLOCK_NS = 10  # of simulated time, whatever the clock rate: rising edge k is at 10 k + 5 ns


def clock() -> int:
    """Number of the last rising clock edge."""
    return (int(get_sim_time("ns")) - 5) // _CLOCK_NS


async def until(k: int) -> None:
    """To the middle of clock k: what is driven there counts as an edge on the pin at clock edge k."""
    delta = (k + 1) * _CLOCK_NS - int(get_sim_time("ns"))
    if delta > 0:
        await Timer(delta, "ns")


class Failed(Exception):
    """The device did something else than it must."""


@dataclass
class Request:
    """One request on the line: clock of its first edge, edges and changes of tx_en from there on."""
    first: int
    lead: int | None               # clocks tx_en was on before
    edges: list = field(default_factory=list)
    enables: list = field(default_factory=list)


class Bench:
    def __init__(self, adapter):
        self.adapter, self.times = adapter, Times(adapter.hz)
        self.requests: list[Request] = []
        self.results: list = []
        self.expect = None          # (lo, hi, decided, owner): clocks of the next first edge
        self.offered = None         # the case whose request the device has or will take
        self.following = None       # the case to offer when the result comes
        self.wake = Event()
        self.stalled = False
        self.count = 0
        self.enabled_at = None
        self.task = None            # drives what goes on beside the case

    # ------------------------------------------------------------------------------------ watching
    async def start(self):
        """Reset, watchers, enable."""
        self.adapter.echo(0)
        await self.reset()
        for task in (self._watch_man, self._watch_enable, self._watch_results, self._watch_stall):
            cocotb.start_soon(task())

    async def reset(self):
        """Device and bench as at the start."""
        self.following = None
        if self.task is not None:
            self.task.cancel()
            self.task = None
        self.adapter.reset(1)
        self.adapter.enable(0)
        for pin in self.adapter.rx.values():
            pin.value = 0
        await Timer(1500, "ns")   # longer than every echo
        self.adapter.reset(0)
        self.adapter.enable(1)
        self.requests, self.results, self.expect, self.offered, self.stalled = [], [], None, None, False
        self.count, self.enabled_at = 0, None

    async def _watch_man(self):
        man, change, cell = self.adapter.man, ValueChange(self.adapter.man), self.times.us(80)
        self.rise = None
        while True:
            await change
            now, level = clock(), int(man.value)
            if not level and (not self.requests or now - self.requests[-1].first > cell):
                # tx_en may rise in the same clock
                lead = now - self.rise if self.rise is not None else 0 if int(self.adapter.en.value) else None
                self.requests.append(Request(now, lead))
                self.wake.set()
            if self.requests:
                request = self.requests[-1]
                if len(request.edges) < 40:
                    request.edges.append((now - request.first, 1 if level else -1))
                else:
                    self.wake.set()

    async def _watch_enable(self):
        enable, change = self.adapter.en, ValueChange(self.adapter.en)
        while True:
            await change
            level = int(enable.value)
            self.rise = clock() if level else None
            if self.requests and len(self.requests[-1].enables) < 40:
                self.requests[-1].enables.append((clock() - self.requests[-1].first, level))

    async def _watch_results(self):
        change = ValueChange(self.adapter.result_signal)
        while True:
            await change
            self.results.append((clock(), self.adapter.result()))
            if self.following is not None and len(self.results) == 1:
                self._offer(self.following)
            self.wake.set()

    async def _watch_stall(self):
        change = ValueChange(self.adapter.stalled)
        while True:
            await change
            self.stalled = True
            self.wake.set()

    # ------------------------------------------------------------------------------------ playing
    def _offer(self, case):
        self.adapter.echo(case.steps[0].echo)
        self.adapter.offer(case.call, case.retries, case.no_reply)
        self.offered, self.following = case, None

    async def _wait(self, condition, what):
        requests = len(self.requests)
        while not condition():
            if self.stalled:
                raise Failed(f"{what}: nothing in 3 ms")
            if len(self.requests) > requests + 1:   # a device that sends for ever
                raise Failed(f"{what}, but requests")
            self.wake.clear()
            await self.wake.wait()

    async def _drive(self, pins, base):
        """Pulses of one attempt; ends early when the next request starts."""
        count, changes = len(self.requests), []
        for sign, pin in self.adapter.rx.items():
            runs = []
            for time, _, width in sorted(p for p in pins if p[1] == sign):
                if runs and time <= runs[-1][1]:
                    runs[-1][1] = max(runs[-1][1], time + width)
                else:
                    runs.append([time, time + width])
            changes += [(edge, pin, level) for run in runs for edge, level in zip(run, (1, 0))]
        for time, pin, level in sorted(changes, key=lambda c: c[0]):
            await until(base + time)
            if len(self.requests) != count:
                break
            pin.value = level
        else:
            return
        for pin in self.adapter.rx.values():
            pin.value = 0

    def _check_request(self, request, call):
        """Edges of a request that is over, and tx_en."""
        expected = train(request_word(call), self.times.half)
        if request.edges != expected:
            raise Failed(f"edges of request {call:03X}: {request.edges}, not {expected}")
        t = self.times
        if request.lead is None or request.lead > t.bias:
            raise Failed(f"tx_en leads by {request.lead} clocks")
        fall = next((at for at, level in request.enables if not level), None)
        if fall is None or not t.request <= fall <= t.us(81) + 2:
            raise Failed(f"tx_en drops {fall} clocks after the first edge")

    def _check_start(self, request):
        """Gap and lead of tx_en of a request that has just begun -> message for the case that owns the gap, or None."""
        if self.expect is None:
            return None
        lo, hi, decided = self.expect
        slack = self.adapter.slack
        if not lo - slack <= request.first <= hi + slack:
            return f"next request {request.first - lo:+} clocks from {'the earliest time' if hi > lo else 'its time'}"
        need = min(self.times.bias, lo - decided - self.times.act - 8)
        if lo == hi and (request.lead is None or request.lead < need - slack):
            return f"tx_en leads the next request by {request.lead}, not {need} clocks"
        return None

    def _same(self, got, wanted):
        return got in wanted or ("classes" not in self.adapter.abilities and got not in (OK, ABORTED)
                                 and not {OK, ABORTED} & set(wanted))

    async def _play(self, case):
        """-> message about the gap of the case before, or None; Failed for this case."""
        t, before = self.times, None
        if case.kind == "late" and self.expect:
            await until(self.expect[1] + case.at)
            self.expect = (clock() + t.bias, clock() + t.bias + 6, clock())
        if case.kind == "idle":
            await self._idle(case)
        if self.offered is not case:
            self._offer(case)
        if case.kind == "idle":
            await self._drive(case.steps[0].pins, self.enabled_at)
        self.offered = None
        self.results = []
        for step, outcome in zip(case.steps, case.outcomes):
            seen = self.count
            await self._wait(lambda: len(self.requests) > seen, "no request")
            self.count += 1
            request = self.requests[seen]
            message = self._check_start(request)
            if message and step is case.steps[0] and case.kind == "call":
                before = message
            elif message:
                raise Failed(message)
            last = request.first + t.request
            if case.kind == "abort":
                return await self._abort(case, request, last) or before
            if len(self.requests) != self.count:
                raise Failed("a request too many")
            if step is case.steps[-1]:
                self.following = self.next_case
            if case.kind != "idle":
                await self._drive(step.pins, last)
            self.expect = (last + outcome.next_lo, last + outcome.next_hi, last + outcome.decided)
            if step is not case.steps[-1]:
                await self._wait(lambda: len(self.requests) > self.count or self.results, "no repetition")
                if self.results:
                    raise Failed(f"result before the last attempt: {self.results[0][1]}")
                self._check_request(request, case.call)
        await self._wait(lambda: self.results, "no result")
        self._check_request(request, case.call)
        if len(self.results) > 1:
            raise Failed(f"{len(self.results)} results")
        at, result = self.results[0]
        wanted = (case.outcomes[-1].error, *case.also)
        first = (case.outcomes[0].error, *case.also)
        if not self._same(result.last, wanted) or not self._same(result.first, first):
            raise Failed(f"class {result.last} (first {result.first}), not {'/'.join(wanted)} ({'/'.join(first)})")
        if result.last == OK and case.outcomes[-1].data is not None and result.data != case.outcomes[-1].data:
            raise Failed(f"data {result.data:X}, not {case.outcomes[-1].data:X}")
        if result.repeats != len(case.steps) - 1:
            raise Failed(f"{result.repeats} repetitions, not {len(case.steps) - 1}")
        due = request.first + t.request + case.outcomes[-1].decided
        if not due <= at <= due + t.act + self.adapter.slack:
            raise Failed(f"result {at - due:+} clocks from its time")
        return before

    async def _idle(self, case):
        """Stop between two calls, start again; sets when the next request is due."""
        t = self.times
        self.adapter.enable(0)
        await until(clock() + t.us(100))   # the request that may just have begun is over
        self.count = len(self.requests)
        self.adapter.enable(1)
        self.enabled_at = clock()
        due = (self.enabled_at + t.idle, self.enabled_at + t.idle + 4)
        for time, _, _ in case.steps[0].pins:
            if self.enabled_at + time < due[0]:
                due = (self.enabled_at + time + t.idle,) * 2
        self.expect = (*due, self.enabled_at)

    async def _abort(self, case, request, last):
        t = self.times
        self.task = cocotb.start_soon(self._drive(case.steps[0].pins, last))
        self.following = self.next_case
        await until(last + case.at)
        if self.results:
            raise Failed(f"result before the stop: {self.results[0][1]}")
        self.adapter.enable(0)
        stopped = clock()
        await until(last + t.us(200))
        if len(self.results) != 1 or self.results[0][1].last != ABORTED or self.results[0][0] > stopped + 4:
            raise Failed(f"stopped at {stopped}: {self.results}")
        if len(self.requests) != self.count:
            raise Failed("a request while stopped")
        self._check_request(request, case.call)
        self.adapter.enable(1)
        self.expect = (clock() + t.idle, clock() + t.idle + 4, clock())

    async def run(self, cases, stop_first=False):
        """-> [(case, message)] of the cases that failed; stop_first: at most one."""
        failed, previous = [], None
        end = self.times.timeout + self.times.gap_norsp
        closing = Case("closing", "measures the gap of the last case", (), 0, [Step([], 0)],
                       outcomes=[Outcome("NO_RESPONSE", None, self.times.timeout, end, end)])
        order = [*cases, closing]
        for case, following in zip(order, [*order[1:], None]):
            self.next_case = following if following is not None and following.kind in ("call", "abort") else None
            try:
                message = await self._play(case)
                if message and previous is not None:
                    failed.append((previous, message))
            except Failed as error:
                failed.append((case if case is not closing else previous, str(error)))
                if not stop_first:
                    await self.reset()
                    case = None   # its gap is not measured
            if failed and stop_first:
                break
            previous = case
        return failed
