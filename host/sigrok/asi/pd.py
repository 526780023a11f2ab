# SPDX-License-Identifier: Apache-2.0
"""sigrok decoder for AS-Interface: channels in, annotations out. All decisions are those of the asi library.

The library modules stand next to this file in the installed folder (`make sigrok`). Times in ns, places in samples.
"""
import json
import re
from collections import deque

import sigrokdecode as srd

from asi.capture import FILTER_NS, LOWEST_RATE_HZ, Comparators, Manchester, Sink
from asi.checks import ANSWER_BITS, HALF_BIT_NS, REQUEST_BITS, WIN_LATE_NS, bit_values, end_ns
from asi.decode import Decoder as Telegrams
from asi.decode import Extended
from asi.monitor import RX_TIMEOUT_NS
from asi.telegram import BIT_NS, parse_numbers

P, N, MAN = range(3)                # channels
NEGATIVE, POSITIVE, BIT, REQUEST, DELAY, ANSWER, BAD, ERROR, NOTE = range(9)    # annotation classes
PULSE_NS = 1_500                    # a pulse is drawn this long from its start, whatever its width
KEPT_PULSES = 128                   # of one request, its answer and the noise around: 27 + 13 and some
REQUEST_NAMES = ("ST", "CB", "A4", "A3", "A2", "A1", "A0", "I4", "I3", "I2", "I1", "I0", "PB", "EB")
ANSWER_NAMES = ("ST", "I3", "I2", "I1", "I0", "PB", "EB")


class SamplerateError(Exception):
    pass


class ChannelError(Exception):
    pass


class OptionError(Exception):
    pass


class Decoder(srd.Decoder):
    api_version = 3
    id = "asi"
    name = "AS-i"
    longname = "AS-Interface"
    desc = "Actuator Sensor Interface, IEC 62026-2."
    license = "apache-2.0"
    inputs = ["logic"]
    outputs = ["asi"]
    tags = ["Embedded/industrial"]
    optional_channels = (
        {"id": "rx_p", "name": "rx_p", "desc": "Positive pulses (comparator)"},
        {"id": "rx_n", "name": "rx_n", "desc": "Negative pulses (comparator)"},
        {"id": "man", "name": "MAN", "desc": "Manchester level, idle high, instead of the two"},
    )
    options = (
        {"id": "input", "desc": "Input (auto: the pulses when both are connected)", "default": "auto",
         "values": ("auto", "pulses", "man")},
        {"id": "swap", "desc": "Wires swapped; MAN: idle low", "default": "no", "values": ("no", "yes")},
        {"id": "ab", "desc": "Numbers with A/B addressing, as 5+7+20-31; none; empty: learned", "default": ""},
    )
    annotations = (
        ("negative", "Negative pulse"), ("positive", "Positive pulse"), ("bit", "Bit"), ("request", "Request"),
        ("delay", "Delay of the answer"), ("answer", "Answer"), ("bad", "Bad telegram"), ("error", "Error"),
        ("note", "Note"),
    )
    annotation_rows = (
        ("pulses", "Pulses", (NEGATIVE, POSITIVE)),
        ("bits", "Bits", (BIT,)),
        ("telegrams", "Telegrams", (REQUEST, DELAY, ANSWER, BAD)),
        ("warnings", "Warnings", (ERROR, NOTE)),
    )
    binary = (("jsonl", "Telegrams as JSON lines"),)

    def __init__(self):
        self.reset()

    def reset(self):
        self.samplerate = None

    def metadata(self, key, value):
        if key == srd.SRD_CONF_SAMPLERATE:
            self.samplerate = value

    def start(self):
        self.out_ann = self.register(srd.OUTPUT_ANN)
        self.out_python = self.register(srd.OUTPUT_PYTHON)
        self.out_binary = self.register(srd.OUTPUT_BINARY)

    # ------------------------------------------------------------------ set-up
    def _kind(self):
        """'pulses' or 'man', by option and by what is connected."""
        pair, man = self.has_channel(P) and self.has_channel(N), self.has_channel(MAN)
        kind = self.options["input"]
        if kind == "auto":
            kind = "pulses" if pair else "man"
        if not (pair if kind == "pulses" else man):
            raise ChannelError("connect rx_p and rx_n, or MAN" if self.options["input"] == "auto" else
                               "connect rx_p and rx_n" if kind == "pulses" else "connect MAN")
        return kind

    def _known(self):
        """Function: number -> uses A/B addressing, None: not known."""
        text = self.options["ab"].strip().lower()
        if not text:
            return lambda number: None
        try:  # a comma would end the decoder's options on sigrok-cli's command line
            return (frozenset() if text == "none" else parse_numbers(re.sub(r"[\s+;/]+", ",", text))).__contains__
        except ValueError as error:
            raise OptionError(f"ab: {error}") from None

    # ------------------------------------------------------------------ the line
    def decode(self):
        if not self.samplerate:
            raise SamplerateError("Cannot decode without samplerate.")
        if self.samplerate < LOWEST_RATE_HZ:
            raise SamplerateError(f"a sample rate of at least {LOWEST_RATE_HZ / 1e6:g} MHz is needed")
        kind, invert = self._kind(), self.options["swap"] == "yes"
        self._pulses = deque(maxlen=KEPT_PULSES)    # (ns, polarity), newest last
        self._noted = 0
        self._telegrams = Telegrams(self._telegram, Extended(self._known()))
        sink = self._telegrams.sink()
        sink.begin(0.0)
        self._sink_pulse = sink.pulse
        filter_ns = max(0.0, FILTER_NS - 1e9 / self.samplerate)  # a pulse may look one sample shorter than it is
        if kind == "pulses":
            front = Comparators(Sink(self._pulse), filter_ns, invert)
            edges = [{P: "e"}, {N: "e"}]
        else:
            front = Manchester(Sink(self._pulse), filter_ns, invert)
            edges = [{MAN: "e"}]
        self._run(kind, front, edges, filter_ns)

    def _run(self, kind, front, edges, filter_ns):
        telegrams, rate = self._telegrams, self.samplerate
        pins = self.wait({"skip": 0})
        edge = False
        try:
            while True:
                now = self.samplenum * 1e9 / rate
                if kind == "pulses":
                    front.levels(now, pins[P], pins[N])
                else:
                    front.level(now, pins[MAN])
                if not edge:    # pulses that began up to here have all been reported
                    telegrams.settle(now - filter_ns)
                    self._notes()
                due = telegrams.due_ns
                if due is None and edge:        # nothing open, but a pulse may have begun
                    due = now
                if due is None:
                    pins = self.wait(edges)
                    edge = True
                else:           # silence ends a telegram as well: wake up when it does
                    wake = int((due + filter_ns) * rate / 1e9) + 1
                    pins = self.wait([*edges, {"skip": max(1, wake - self.samplenum)}])
                    edge = any(self.matched[:len(edges)])
        except EOFError:        # libsigrokdecode from 0.6 on says when the samples end; before, decode() just ends
            now = self.samplenum * 1e9 / rate
            front.settle(now)
            telegrams.end(now)
            self._notes()

    def _pulse(self, t_ns, polarity):
        kind, text = (POSITIVE, "+") if polarity > 0 else (NEGATIVE, "-")
        self._put(t_ns, t_ns + PULSE_NS, kind, [text])
        self._sink_pulse(t_ns, polarity)        # may finish the telegram before
        self._notes()
        self._pulses.append((t_ns, polarity))

    # ------------------------------------------------------------------ what is shown
    def _telegram(self, record):
        begin = record["t_ns"] - 1              # rounded to ns
        train = [pulse for pulse in self._pulses if pulse[0] >= begin]
        self._pulses.clear()
        t_ns = train[0][0] if train else record["t_ns"]
        if record["request_ok"]:
            end = t_ns + end_ns(REQUEST_BITS)
            request = [pulse for pulse in train if pulse[0] <= end + WIN_LATE_NS]
            answer = train[len(request):]
            end = self._request(record, request)
            if record["delay_ns"] is not None:
                end = self._answer(record, request[-1][0] + record["delay_ns"], answer, end)
            elif record["class"] != "OK":
                end = request[-1][0] + RX_TIMEOUT_NS
                self._error(record, request[-1][0], end)
        else:
            end = (train[-1][0] if train else t_ns) + HALF_BIT_NS
            self._bits(train, REQUEST_NAMES)
            self._put(t_ns - HALF_BIT_NS, end, BAD, ["bad request", "bad"])
            self._error(record, t_ns - HALF_BIT_NS, end)
        start, stop = self._at(t_ns - HALF_BIT_NS), self._at(end)
        self.put(start, stop, self.out_python, ["TELEGRAM", record])
        line = json.dumps(record, separators=(",", ":")) + "\n"
        self.put(start, stop, self.out_binary, [0, line.encode()])

    def _request(self, record, train):
        """-> its end."""
        start, end = train[0][0] - HALF_BIT_NS, train[-1][0] + HALF_BIT_NS
        self._bits(train, REQUEST_NAMES)
        address = record["address"] or "all"
        text = " ".join(filter(None, (record["call"], address, record["data"])))
        texts = [text, f"{record['call']} {address}", address]
        self._put(start, end, REQUEST, [f"{text}, repeated", *texts] if record["repeated"] else texts)
        return end

    def _answer(self, record, first, train, request_end):
        """-> its end. first: its first pulse, which may not be in train when it came too early."""
        train = [pulse for pulse in train if pulse[0] <= first + end_ns(ANSWER_BITS) + BIT_NS + WIN_LATE_NS]
        start = max(first - HALF_BIT_NS, request_end)
        end = (train[-1][0] if train else first) + HALF_BIT_NS
        self._bits(train, ANSWER_NAMES)
        delay = f"{record['delay_ns'] / 1e3:.3f}"
        if start > request_end:
            self._put(request_end, start, DELAY, [f"{delay} us", delay])
        if record["answer"] is not None:
            nibble = record["answer"]
            self._put(start, end, ANSWER, [nibble, f"{int(nibble, 2):X}"])
        else:
            self._put(start, end, BAD, [f"bad answer, {record['class']}", "bad answer", "bad"])
            self._error(record, start, end)
        return end

    def _bits(self, train, names):
        """Every bit at its place on the grid of the first pulse; '?' where its pulse is missing."""
        if not train:
            return
        first = train[0][0]
        values = bit_values([(t - first, polarity) for t, polarity in train], len(names))
        seen = max(k for k, value in enumerate(values) if value is not None)
        for k, (name, value) in enumerate(zip(names, values[:seen + 1])):
            middle, digit = first + k * BIT_NS, "?" if value is None else str(value)
            self._put(middle - HALF_BIT_NS, middle + HALF_BIT_NS, BIT, [f"{name} {digit}", digit])

    def _error(self, record, start, end):
        name = record["class"]
        texts = [name, "!"] if record["address"] is None else [f"{name} {record['address']}", name, "!"]
        if name == "START" and not record["request_ok"]:
            texts.insert(0, "START: the first pulse is positive; are the wires swapped?")
        self._put(start, end, ERROR, texts)

    def _notes(self):
        notes = self._telegrams.notes
        while self._noted < len(notes):
            note, self._noted = notes[self._noted], self._noted + 1
            train = self._pulses or [(self.samplenum * 1e9 / self.samplerate, 0)]
            self._put(train[0][0] - HALF_BIT_NS, train[-1][0] + HALF_BIT_NS, NOTE, [note, "note", "i"])
            if "start of the capture" in note:  # the rest of a telegram: not part of the next one
                self._pulses.clear()

    # ------------------------------------------------------------------ places
    def _at(self, t_ns):
        return max(0, round(t_ns * self.samplerate / 1e9))

    def _put(self, start_ns, stop_ns, kind, texts):
        start = self._at(start_ns)
        self.put(start, max(start + 1, self._at(stop_ns)), self.out_ann, [kind, texts])
