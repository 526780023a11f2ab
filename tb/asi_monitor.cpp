// SPDX-License-Identifier: Apache-2.0
#include "asi_monitor.h"

#include <algorithm>

namespace asi {
namespace {
constexpr int64_t kLengthQuiet = kBit + kWinLate;  // silence after an end pulse's nominal time
constexpr int64_t kRequestGap = 2 * kBit + kWinLate;  // a request that lost one pulse still has no longer gap
constexpr int64_t kRxOpen = 12'000;                // an answer may start this long after the last request pulse ...
constexpr int64_t kRxTimeout = 66'000;             // ... and no later than this
constexpr int64_t kRepeatWithin = 220'000;         // request to request
constexpr size_t kLogMax = 1 << 20;                // records kept for a reader that does not come
constexpr int64_t kFoldFrom = 1'000, kFoldBin = 25;  // asi_pulse_counts
constexpr int16_t kNoDeviation = INT16_MIN;

// The pulse of a good telegram that is farthest from its grid point, with sign.
int16_t deviation(const std::vector<Pulse> &pulses) {
    int64_t widest = 0;
    for (const Pulse &p : pulses) {
        const int64_t d = p.t - pulses.front().t;
        const int n = window_of(d);
        if (n < 0) continue;  // after the length window
        const int64_t late = d - n * kHalfBit;
        if (late * late > widest * widest) widest = late;
    }
    return static_cast<int16_t>(widest);
}
}  // namespace

ErrorClass check_telegram(const std::vector<Pulse> &pulses, int bits, unsigned &word) {
    const int end_window = 2 * (bits - 1);
    const int64_t first = pulses.front().t;
    bool alternation = false, timing = false, length = false;
    int window = 0;                // of the last pulse that was in one
    uint32_t found = 1, ones = 0;  // per bit: a pulse was there; it was positive
    for (size_t i = 1; i < pulses.size(); i++) {
        if (window == end_window) { length = true; continue; }  // after the end pulse nothing else matters
        if (pulses[i].t == pulses[i - 1].t) { timing = true; continue; }  // two senders; the first stands for both
        const size_t before = i >= 2 && pulses[i - 1].t == pulses[i - 2].t ? i - 2 : i - 1;
        alternation |= pulses[i].polarity == pulses[before].polarity;
        const int n = window_of(pulses[i].t - first);
        if (n <= window || n > end_window) { timing = true; continue; }  // dead zone, second one, too late
        window = n;
        if (n % 2 == 0) {
            found |= 1u << (n / 2);
            if (pulses[i].polarity > 0) ones |= 1u << (n / 2);
        }
    }
    word = 0;
    for (int k = 0; k < bits; k++) word = word << 1 | (ones >> k & 1);
    if (pulses.front().polarity > 0) return ErrorClass::kStart;
    if (alternation) return ErrorClass::kAlternation;
    if (timing) return ErrorClass::kTiming;
    if (found != (1u << bits) - 1) return ErrorClass::kNoInformation;
    if (!(word & 1)) return ErrorClass::kEndBit;
    if (parity(word >> 1)) return ErrorClass::kParity;
    return length ? ErrorClass::kLength : ErrorClass::kOk;
}

void Monitor::pulse(const Pulse &pulse, bool from_master, uint8_t phase) {
    advance(pulse.t);
    if (from_master) {
        if (state_ == State::kAnswer) {  // a new request before the old one had its time: take what is there
            unsigned word = 0;
            if (answer_.empty()) finish(ErrorClass::kNoResponse, 0);
            else { const ErrorClass e = check_telegram(answer_, 7, word); finish(e, word >> 2 & 15); }
        }
        if (state_ == State::kIdle) {
            state_ = State::kRequest;
            phase_ = phase;
            request_.clear();
            answer_.clear();
        }
        request_.push_back(pulse);
        return;
    }
    if (state_ == State::kRequest && pulse.t - request_.front().t >= kRequestSpan - kWinEarly &&
        pulse.t > request_.back().t) state_ = State::kAnswer;
    if (state_ != State::kAnswer) return;  // a foreign pulse where no answer belongs
    if (answer_.empty() && pulse.t - request_.back().t < kRxOpen) {
        answer_.push_back(pulse);
        finish(ErrorClass::kEarly, 0);
        return;
    }
    answer_.push_back(pulse);
}

void Monitor::advance(int64_t t) {
    if (state_ == State::kRequest && t - request_.back().t > kRequestGap) state_ = State::kAnswer;
    if (state_ != State::kAnswer) return;
    if (!answer_.empty()) {
        if (t - answer_.front().t > kAnswerSpan + kLengthQuiet) {
            unsigned word = 0;
            const ErrorClass error = check_telegram(answer_, 7, word);
            finish(error, word >> 2 & 15);
        }
    } else if (t - request_.back().t > kRxTimeout) {
        finish(ErrorClass::kNoResponse, 0);
    }
}

void Monitor::finish(ErrorClass error, unsigned data) {
    unsigned word = 0;
    asi_telegram r{};
    r.t_ns = request_.front().t;
    r.request_ok = check_telegram(request_, 14, word) == ErrorClass::kOk;
    r.call = static_cast<uint16_t>(word >> 2 & 0x7FF);
    r.request_dev_ns = r.request_ok ? deviation(request_) : kNoDeviation;
    r.answer_dev_ns = error == ErrorClass::kOk && !answer_.empty() ? deviation(answer_) : kNoDeviation;
    count(request_, 0);
    count(answer_, 1);
    r.delay_ns = answer_.empty() ? -1 : static_cast<int32_t>(answer_.front().t - request_.back().t);
    constexpr uint16_t kBroadcast = 1 << 10 | 31 << 5 | 0b10101, kProgram = 1 << 10 | 0b11101;
    if (error == ErrorClass::kNoResponse && r.request_ok && (r.call == kBroadcast || r.call == kProgram))
        error = ErrorClass::kOk;  // these calls have no answer
    r.error_class = static_cast<uint8_t>(error);
    r.data = error == ErrorClass::kOk ? static_cast<uint8_t>(data) : 0;
    r.phase = phase_;
    r.repeated = telegrams > 0 && r.request_ok && last_.request_ok && last_.call == r.call &&
                 last_.error_class != static_cast<uint8_t>(ErrorClass::kOk) && r.t_ns - last_.t_ns <= kRepeatWithin;
    telegrams++;
    repeated += r.repeated;
    failed += error != ErrorClass::kOk;
    last_ = r;
    if (log_.size() == kLogMax) log_.pop_front();
    log_.push_back(r);
    state_ = State::kIdle;
}

void Monitor::count(const std::vector<Pulse> &pulses, int sender) {
    const auto bin = [](int64_t d) { return (d + kFoldFrom) % kBit / kFoldBin; };
    for (size_t i = 1; i < pulses.size(); i++) {
        const int64_t d = pulses[i].t - pulses.front().t;
        const int sign = pulses[i].polarity > 0;
        counts_.starts[sender][sign][bin(d)]++;
        counts_.ends[sender][sign][bin(d + pulses[i].width)]++;
    }
}

int Monitor::drain(asi_telegram *out, int max) {
    const int n = static_cast<int>(std::min<size_t>(log_.size(), max > 0 ? static_cast<size_t>(max) : 0));
    std::copy_n(log_.begin(), n, out);
    log_.erase(log_.begin(), log_.begin() + n);
    return n;
}

}  // namespace asi
