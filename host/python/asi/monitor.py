# SPDX-License-Identifier: Apache-2.0
"""Passive monitor: turns the pulses of a line into one record per call, whoever sent them. Times in ns."""
from dataclasses import dataclass, field

from asi.checks import ANSWER_BITS, QUIET_NS, REQUEST_BITS, WIN_LATE_NS, RequestCollector, classify, deviation, end_ns
from asi.regmap import ErrorClass

RX_OPEN_NS = 12_000         # P_RX_OPEN
RX_TIMEOUT_NS = 66_000      # P_RX_TIMEOUT
PAUSE_NS = 18_000           # least P_GAP_ERR: quiet after which the next pulse starts a request
REPEAT_NS = 220_000         # the same call, started within this after a failed one, is an immediate repetition
BR01_CALL = 1 << 10 | 31 << 5 | 0b10101
PRGM_CALL = 1 << 10 | 0b11101
REQUEST_NS = end_ns(REQUEST_BITS) + QUIET_NS + WIN_LATE_NS
ANSWER_NS = end_ns(ANSWER_BITS) + QUIET_NS + WIN_LATE_NS    # length window of an answer, from its first pulse


@dataclass
class Telegram:
    """One call. t_ns: first pulse of the request; delay_ns: last request pulse to first answer pulse, -1 without.

    error_class judges the answer, or the request itself when request_ok is False (then call is None).
    data: the answer nibble when error_class is OK and there was an answer, else None.
    request_dev_ns, answer_dev_ns: largest distance of a pulse from the grid in a good request, a good answer.
    lone_answer: the nibble when what looked like a request was a good answer; its request was not seen.
    """
    t_ns: float
    call: int | None = None
    delay_ns: float = -1
    error_class: ErrorClass = ErrorClass.OK
    data: int | None = None
    phase: int = 0
    repeated: bool = False
    request_ok: bool = True
    request_dev_ns: float | None = field(default=None, compare=False)
    answer_dev_ns: float | None = field(default=None, compare=False)
    lone_answer: int | None = field(default=None, compare=False)


class Monitor:
    """Listens on a line; finished records are in telegrams. phase: function giving phase_e, called per request.

    sink: gets the finished records instead of telegrams, so that nothing grows.
    listen(sender, t0_ns, pulses): gets the pulses of each request (sender 0) and answer (1), good or not, as
    [(ns from the first pulse at t0_ns, polarity)].
    """

    def __init__(self, line=None, phase=lambda: 0, sink=None, listen=None):
        self.telegrams = []
        self._listen = listen
        self._sink = sink or self.telegrams.append
        self._phase = phase
        self._record = self._previous = None
        self._asked = None          # (t0, pulses) of the request, for listen
        self._step = self._idle
        self._pulses = []           # (ns from the first, polarity) of the telegram on the line
        self._t0 = self._end_ns = 0
        self._last_ns = float("-inf")
        self._request = None
        if line:
            line.listen(lambda pulse: self.pulse(pulse.t_ns, pulse.polarity))

    def pulse(self, t_ns, polarity):
        """The next pulse, in order of time."""
        self.settle(t_ns)
        self._step(t_ns, polarity)
        self._last_ns = t_ns

    def settle(self, t_ns):
        """Finish what the silence until t_ns (not included) finishes; call it before reading telegrams."""
        if self._step == self._waiting and t_ns > self._end_ns + RX_TIMEOUT_NS:
            silent = self._record.call in (BR01_CALL, PRGM_CALL)
            self._close(ErrorClass.OK if silent else ErrorClass.NO_RESPONSE, self._idle)
        elif self._step == self._answer and t_ns > self._t0 + ANSWER_NS:
            error, word = classify(self._pulses, ANSWER_BITS)
            if error is ErrorClass.OK:
                self._record.data = word >> 2 & 15
                self._record.answer_dev_ns = deviation(self._pulses)
            self._close(error, self._idle if error is ErrorClass.OK else self._noise)
        elif self._step == self._bad_request and t_ns - self._last_ns >= PAUSE_NS:
            self._finish_bad_request()
        elif self._step == self._receiving and not self._request.alive(t_ns):
            self._step = self._bad_request
            if t_ns - self._last_ns >= PAUSE_NS:
                self._finish_bad_request()
        if self._step == self._noise and t_ns - self._last_ns >= PAUSE_NS:
            self._step = self._idle

    @property
    def open(self):
        """The record that is not finished and what it lacks, None between two telegrams."""
        lack = {self._receiving: "the request is cut off", self._bad_request: "the request is bad or cut off",
                self._waiting: "no answer yet", self._answer: "the answer is cut off"}.get(self._step)
        return (self._record, lack) if lack else None

    # ------------------------------------------------------------------ one method per state
    def _idle(self, t_ns, polarity):
        self._t0, self._pulses = t_ns, [(0, polarity)]
        self._request = RequestCollector(t_ns, polarity)
        self._record = Telegram(t_ns, phase=self._phase())
        self._step = self._receiving if polarity < 0 else self._bad_request

    def _receiving(self, t_ns, polarity):
        self._pulses.append((t_ns - self._t0, polarity))
        if not self._request.add(t_ns, polarity):
            self._step = self._bad_request
        elif self._request.call is not None:
            self._end_ns = t_ns
            self._asked = (self._t0, self._pulses)
            self._record.call = self._request.call
            self._record.request_dev_ns = deviation(self._pulses)
            self._step = self._waiting

    def _bad_request(self, t_ns, polarity):
        if t_ns - self._t0 <= REQUEST_NS:
            self._pulses.append((t_ns - self._t0, polarity))

    def _waiting(self, t_ns, polarity):
        self._record.delay_ns = t_ns - self._end_ns
        if self._record.delay_ns < RX_OPEN_NS:
            self._close(ErrorClass.EARLY, self._noise)
        else:
            self._t0, self._pulses = t_ns, [(0, polarity)]
            self._step = self._answer

    def _answer(self, t_ns, polarity):
        self._pulses.append((t_ns - self._t0, polarity))

    def _noise(self, t_ns, polarity):
        pass

    # ------------------------------------------------------------------ closing a record
    def _finish_bad_request(self):
        self._record.request_ok = False
        error, word = classify(self._pulses, ANSWER_BITS)
        if error is ErrorClass.OK:
            self._record.lone_answer = word >> 2 & 15
        self._close(classify(self._pulses, REQUEST_BITS)[0], self._idle)

    def _close(self, error, step):
        record, previous = self._record, self._previous
        record.error_class = error
        record.repeated = bool(previous and previous.error_class != ErrorClass.OK and previous.call == record.call
                               and record.call is not None and record.t_ns - previous.t_ns <= REPEAT_NS)
        self._previous = record
        if self._listen:
            if self._asked is not None:
                self._listen(0, *self._asked)
            if self._step in (self._answer, self._bad_request):
                self._listen(int(self._step == self._answer), self._t0, self._pulses)
        self._asked = None
        self._step = step
        self._sink(record)
