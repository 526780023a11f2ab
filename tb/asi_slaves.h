// SPDX-License-Identifier: Apache-2.0
// asi_slaves.h: simulated slaves on one line, event driven, pulse level, in ns. Behind asi_net of asi_tb.h.
//
// One listener decodes the master's pulses for all slaves. It has two views, which differ only in the quiet time a
// request needs after its end pulse: a synchronous slave accepts it 6 us (+ the late tolerance) after, an asynchronous
// one 18 us. A bad request makes every slave that heard it asynchronous; it ends with a pause of the view's quiet time.
// Slaves do not listen to each other's answers, nor to injected pulses.
//
// A slave's own timers (reset, power-up, watchdog, non-volatile write) are looked at when something happens to it.
// Requirements: SL-001..SL-006, SL-008..SL-010 (docs/requirements.md).
#pragma once
#include <array>
#include <cstdint>
#include <deque>
#include <limits>
#include <memory>
#include <vector>

#include "asi_ctt_slave.h"
#include "asi_line.h"
#include "asi_monitor.h"
#include "asi_tb.h"

namespace asi {

constexpr int64_t kNever = std::numeric_limits<int64_t>::max();
constexpr int64_t kQuietSync = 6'000, kQuietAsync = 18'000;     // silence after a request
constexpr int64_t kAnswerSync = 21'500, kAnswerAsync = 33'500;  // last request pulse to first answer pulse
constexpr int64_t kResetTime = 1'000'000;                       // not answering after RES, BR01 or the watchdog
constexpr int64_t kPowerUpTime = 10'000'000;                    // not answering after power-up
constexpr int64_t kWriteTime = 15'000'000;                      // non-volatile write after ADRA or WID1, by default
constexpr int64_t kWatchdogTime = 94'200'000;

// xorshift64*: small, and the same on every machine.
class Random {
public:
    explicit Random(uint64_t seed) : state_(seed | 1) { next(); }
    uint32_t next() {
        state_ ^= state_ >> 12;
        state_ ^= state_ << 25;
        state_ ^= state_ >> 27;
        return static_cast<uint32_t>(state_ * 0x2545F4914F6CDD1Dull >> 32);
    }
    bool chance(uint16_t p) { const uint32_t r = next() & 0xFFFF; return r < p || p == 0xFFFF; }
    uint32_t below(uint32_t n) { return static_cast<uint32_t>(static_cast<uint64_t>(next()) * n >> 32); }

private:
    uint64_t state_;
};

// One view of the master's pulses.
class Listener {
public:
    enum class Event { kNone, kGood, kBad };
    explicit Listener(int64_t quiet) : quiet_(quiet) {}
    Event pulse(int64_t t, int32_t polarity);
    Event advance(int64_t t);          // no pulse came before t; kGood at most once per telegram
    int64_t due() const { return state_ == State::kReceive && next_bit_ == 14 ? accept_at() : kNever; }
    unsigned call() const { return word_ >> 2 & 0x7FF; }
    int64_t first() const { return first_; }  // of the telegram an event is about
    int64_t last() const { return last_; }

private:
    enum class State { kIdle, kReceive, kPause };
    int64_t accept_at() const { return first_ + kRequestSpan + quiet_ + kWinLate + 1; }
    void begin(int64_t t);
    const int64_t quiet_;
    State state_ = State::kIdle;
    int64_t first_ = 0, last_ = 0, heard_ = 0;  // heard_: last pulse of any kind, for the pause
    int32_t polarity_ = 0;
    int window_ = 0, next_bit_ = 0;
    unsigned word_ = 0;
};

class Slave {
public:
    Slave(const asi_slave_cfg &cfg, uint64_t seed, int64_t now, bool power);
    // Time passed: a watchdog or a write may have run out.
    void catch_up(int64_t now);
    void set_present(bool present, int64_t now);
    void set_power(bool power, int64_t now);
    // A telegram that began at `first` was good: true and the answer if this slave answers. Only when hears() it.
    bool hears(int64_t first, bool synchronous) const;
    bool request(unsigned call, int64_t now, int64_t last, unsigned &answer);
    void bad_request() { synchronous_ = false; }
    // Pulses of an answer with this slave's faults; empty when the fault is silence.
    void answer_pulses(unsigned nibble, int64_t t, std::vector<Pulse> &out);
    void state(asi_slave_state &out) const;

    uint8_t inputs, periphery_fault = 0;
    asi_slave_faults faults{};
    asi_slave_options options{kWriteTime, 0, 0, 0, 0, 0, 0};
    std::unique_ptr<Transaction> transaction;  // null: plain nibbles

private:
    bool extended() const { return id() == 0xA; }
    bool alive() const { return present_ && power_; }
    // Sel it obeys: A/B slaves only; at address 0 an option
    unsigned sel() const { return extended() && (number_ || options.sel_at_zero) ? id1_ >> 3 : 0; }
    unsigned io() const { return corrupt_ ? 0xF : io_; }
    unsigned id() const { return corrupt_ ? 0xF : id_; }
    unsigned status() const;
    unsigned data_exchange(unsigned data, int64_t t);
    void write_memory(uint8_t &stored, uint8_t value, int64_t now);
    void power_down(int64_t now);
    void restart(int64_t now, int64_t silent);

    const uint8_t io_, id_, id2_;
    const bool watchdog_;
    bool present_, power_;
    uint8_t id1_, stored_id1_;       // bit 3 is Sel of an A/B slave; non-volatile copy
    uint8_t number_, stored_number_; // working address; non-volatile copy
    uint8_t outputs_ = 0xF, parameter_ = 0xF;
    bool dexg_disabled_ = true, synchronous_ = false, corrupt_ = false;
    int64_t ready_at_ = 0;           // deaf before
    int64_t write_end_ = 0;          // a non-volatile write runs until then
    bool writing_ = false, write_fails_ = false, write_failed_ = false;  // fails: the one that runs; failed: the last
    int64_t watchdog_at_ = kNever;
    uint32_t requests_ = 0, answers_ = 0;
    Random random_;
};

}  // namespace asi

struct asi_net {
    explicit asi_net(uint64_t seed_) : seed(seed_) {}
    void master_pulse(int64_t t, int32_t polarity);
    void advance(int64_t t);             // everything that happens until t, t included
    int64_t next_event() const;          // earliest time at which advance() has something to do
    bool take(asi::Pulse &pulse);        // next pulse of slaves or foreign senders that has begun
    void put(const asi::Pulse &pulse);   // a pulse to come; merges with one of the same polarity it touches

    const uint64_t seed;
    int64_t now = 0;
    bool power = true;
    uint8_t phase = 0;                   // phase_e, for the monitor's records
    std::vector<asi::Slave> slaves;
    asi::Monitor monitor;

private:
    void event(asi::Listener &view, asi::Listener::Event event, bool synchronous);
    void advance_view(asi::Listener &view, int64_t t, bool synchronous);
    asi::Listener sync_{asi::kQuietSync}, async_{asi::kQuietAsync};
    std::vector<asi::Pulse> queue_;      // pulses to come, sorted by start, last one first
    std::deque<asi::Pulse> started_;     // for take()
    std::vector<asi::Pulse> scratch_;
};
