// SPDX-License-Identifier: Apache-2.0
// asi_monitor.h: passive monitor. It sees every pulse of the line and makes one record per request.
// Who sent a pulse is told by the bench, so that a disturbed line is never taken apart in the wrong place; everything
// else comes from the pulses alone. Records are closed when the line has shown enough: at the end of the answer's
// length window, at the time-out, or by the next request. Requirements: RX-001..RX-008, RX-011, LT-002, LT-003.
#pragma once
#include <cstdint>
#include <deque>
#include <vector>

#include "asi_line.h"
#include "asi_tb.h"

namespace asi {

enum class ErrorClass : uint8_t {  // error_class_e of rdl/asi.rdl
    kOk = 0, kNoResponse = 1, kStart = 2, kAlternation = 3, kTiming = 4, kNoInformation = 5, kEndBit = 6, kParity = 7,
    kLength = 8, kEarly = 9
};

// All checks of one telegram; pulses: everything from its first pulse to the end of its length window.
// word: the bits found (right aligned), complete when the class is kOk.
ErrorClass check_telegram(const std::vector<Pulse> &pulses, int bits, unsigned &word);

class Monitor {
public:
    // One pulse, in order of time. phase: phase_e at that time, kept for a request's first pulse.
    void pulse(const Pulse &pulse, bool from_master, uint8_t phase);
    void advance(int64_t t);  // nothing more came until t
    int drain(asi_telegram *out, int max);
    const asi_pulse_counts &counts() const { return counts_; }
    uint64_t telegrams = 0, repeated = 0, failed = 0;  // failed: every answer that was not OK

private:
    enum class State { kIdle, kRequest, kAnswer };
    void finish(ErrorClass error, unsigned data);
    void count(const std::vector<Pulse> &pulses, int sender);
    State state_ = State::kIdle;
    std::vector<Pulse> request_, answer_;
    uint8_t phase_ = 0;
    asi_telegram last_{};
    std::deque<asi_telegram> log_;
    asi_pulse_counts counts_{};
};

}  // namespace asi
