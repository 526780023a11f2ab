// SPDX-License-Identifier: Apache-2.0
#include "asi_slaves.h"

#include <algorithm>
#include <new>

namespace asi {
namespace {

// Calls with CB = 1 and I4 = 1 (CA-003); the fourth bit is Sel or its inverse.
enum Command : unsigned { kReadIo = 0b000, kReadId = 0b001, kReadId1 = 0b010, kReadId2 = 0b011, kReset = 0b100,
                          kBroadcast = 0b101, kReadStatus = 0b110 };
constexpr unsigned kAck = 0x6, kDone = 0x0;

// Which data bits are pure outputs, per IO code; D0 is bit 0. Everything else is read at the port.
constexpr std::array<uint8_t, 16> kOutputBits = {
    0b0000,  // 0 IIII, D0 first
    0b1000,  // 1 IIIO
    0b0000,  // 2 IIIB
    0b1100,  // 3 IIOO
    0b0000,  // 4 IIBB
    0b1110,  // 5 IOOO
    0b0000,  // 6 IBBB
    0b0000,  // 7 BBBB
    0b1111,  // 8 OOOO
    0b0111,  // 9 OOOI
    0b0111,  // A OOOB
    0b0011,  // B OOII
    0b0011,  // C OOBB
    0b0001,  // D OIII
    0b0001,  // E OBBB
    0b0000,  // F TTTT
};

uint64_t mix(uint64_t x) {  // splitmix64: neighbouring seeds give unrelated streams
    x += 0x9E3779B97F4A7C15ull;
    x = (x ^ x >> 30) * 0xBF58476D1CE4E5B9ull;
    x = (x ^ x >> 27) * 0x94D049BB133111EBull;
    return x ^ x >> 31;
}

}  // namespace

// ---------------------------------------------------------------------------------------------- listener
void Listener::begin(int64_t t) {
    state_ = State::kReceive;
    first_ = last_ = t;
    polarity_ = -1;
    window_ = 0;
    next_bit_ = 1;
    word_ = 0;
}

Listener::Event Listener::pulse(int64_t t, int32_t polarity) {  // after advance(t): no window before t was empty
    const int64_t silence = t - heard_;
    heard_ = t;
    if (state_ == State::kPause && silence > quiet_) state_ = State::kIdle;
    if (state_ == State::kPause) return Event::kNone;
    bool bad = false;
    if (state_ == State::kIdle) {
        begin(t);
        bad = polarity > 0;                                      // start bit
    } else {
        const int n = window_of(t - first_);
        bad = next_bit_ == 14                                    // length: nothing may follow the end pulse
              || n <= window_                                    // timing (also two pulses in one window)
              || polarity == polarity_                           // alternation
              || (n == 26 && polarity < 0);                      // end bit
        if (!bad && n % 2 == 0) {
            word_ = word_ << 1 | (polarity > 0);
            next_bit_++;
        }
        window_ = n;
        polarity_ = polarity;
        last_ = t;
        if (next_bit_ == 14 && !bad) bad = parity(word_ >> 1);   // ST is 0, EB does not count
    }
    if (!bad) return Event::kNone;
    state_ = State::kPause;
    return Event::kBad;
}

Listener::Event Listener::advance(int64_t t) {
    if (state_ != State::kReceive) return Event::kNone;
    if (next_bit_ == 14) {
        if (t < accept_at()) return Event::kNone;
        state_ = State::kIdle;
        return Event::kGood;
    }
    if (t <= first_ + next_bit_ * kBit + kWinLate) return Event::kNone;
    state_ = State::kPause;                                      // no information
    return Event::kBad;
}

// ---------------------------------------------------------------------------------------------- slave
Slave::Slave(const asi_slave_cfg &cfg, uint64_t seed, int64_t now, bool power)
    : inputs(cfg.inputs & 0xF), transaction(Transaction::make(cfg.io & 0xF, cfg.id & 0xF, cfg.id2 & 0xF)),
      io_(cfg.io & 0xF), id_(cfg.id & 0xF), id2_(cfg.id2 & 0xF),
      watchdog_(cfg.watchdog != 0), present_(cfg.present != 0), power_(power), id1_(cfg.id1 & 0xF), stored_id1_(id1_),
      number_(cfg.address & 31), stored_number_(number_), random_(mix(seed)) {
    // the address says which Sel an A/B slave has; at address 0 only ID1 can
    if (id_ == 0xA && cfg.address) stored_id1_ = static_cast<uint8_t>((id1_ & 7) | (cfg.address >> 5) << 3);
    restart(now, kPowerUpTime);
}

void Slave::restart(int64_t now, int64_t silent) {
    number_ = stored_number_;  // DELA is volatile
    id1_ = stored_id1_;
    outputs_ = parameter_ = 0xF;
    dexg_disabled_ = true;
    synchronous_ = false;
    ready_at_ = now + silent;
    watchdog_at_ = watchdog_ ? ready_at_ + kWatchdogTime : kNever;
    if (transaction) transaction->reset();
}

void Slave::catch_up(int64_t now) {
    if (writing_ && now >= write_end_) {
        writing_ = false;
        write_failed_ = write_fails_;
        if (!write_failed_) corrupt_ = false;
    }
    // a running write keeps the watchdog from biting, not from running out; a slave that nobody serves is reset again
    // and again
    if (!alive() || number_ == 0 || watchdog_at_ == kNever) return;
    for (int64_t bite; (bite = std::max(watchdog_at_, write_end_)) <= now;) restart(bite, kResetTime);
}

void Slave::power_down(int64_t now) {
    catch_up(now);
    if (writing_) {            // the memory is half written
        writing_ = false;
        corrupt_ = true;
        stored_number_ = 0;
    }
    write_end_ = 0;
    restart(now, 0);
}

void Slave::set_present(bool present, int64_t now) {
    if (present == present_) return;
    if (!present && alive()) power_down(now);
    present_ = present;
    if (alive()) restart(now, kPowerUpTime);
}

void Slave::set_power(bool power, int64_t now) {
    if (power == power_) return;
    if (!power && alive()) power_down(now);
    power_ = power;
    if (alive()) restart(now, kPowerUpTime);
}

bool Slave::hears(int64_t first, bool synchronous) const {
    return alive() && synchronous_ == synchronous && first >= ready_at_;
}

unsigned Slave::status() const {
    return writing_ | (periphery_fault != 0) << 1 | (corrupt_ || write_failed_) << 3;
}

void Slave::write_memory(uint8_t &stored, uint8_t value, int64_t now) {
    write_fails_ = options.write_fails;
    if (!write_fails_) stored = value;  // else the old content stays
    writing_ = true;
    write_end_ = now + options.write_ns;
}

unsigned Slave::data_exchange(unsigned data, int64_t t) {
    const unsigned payload = extended() ? 7 : 15;  // D3 of an A/B slave is an input; its register keeps 1
    outputs_ = static_cast<uint8_t>((data & payload) | (0xF & ~payload));
    const unsigned echo = kOutputBits[io()] & payload;
    const unsigned plain = (outputs_ & echo) | (inputs & ~echo & 0xF);
    return transaction && !corrupt_ ? transaction->exchange(data, plain, t) : plain;  // corrupt: IO = ID = F, plain
}

bool Slave::request(unsigned call, int64_t now, int64_t last, unsigned &answer) {
    const unsigned number = call >> 5 & 31, info = call & 31, low = info & 7;
    const bool control = call >> 10, i4 = info >> 4, i3 = info >> 3 & 1;
    synchronous_ = true;
    if (control && number == 31 && i4 && !i3 && low == kBroadcast) {
        requests_++;
        restart(last, kResetTime);
        return false;
    }
    if (number != number_) return false;
    const bool mine = i3 == (sel() != 0), mine_inv = !mine;  // I3 carries Sel; ~Sel
    if (!control && number == 0) {                   // ADRA
        requests_++;
        number_ = static_cast<uint8_t>(info);
        if (watchdog_) watchdog_at_ = now + kWatchdogTime;  // time at address 0 does not count
        write_memory(stored_number_, number_, now);
        answer = kAck;
    } else if (!control) {                           // DEXG, WPAR
        if (extended() && !mine_inv) return false;
        requests_++;
        if (i4) {
            parameter_ = static_cast<uint8_t>(extended() ? 8 | low : info & 15);
            dexg_disabled_ = false;
            if (transaction && !corrupt_) transaction->parameter(parameter_, last);
            answer = parameter_;
        } else {
            if (dexg_disabled_) return false;
            answer = data_exchange(info & 15, last);
        }
        if (watchdog_) watchdog_at_ = now + kWatchdogTime;
    } else if (!i4) {
        if (number == 0) {                           // WID1
            if (options.id1_locked && ((info ^ id1_) & 7)) return false;
            requests_++;
            id1_ = static_cast<uint8_t>(info & 15);
            write_memory(stored_id1_, id1_, now);    // only ID1 is written; DELA stays volatile
            answer = kDone;
        } else {                                     // DELA
            if (low != 0 || !mine) return false;
            requests_++;
            number_ = 0;
            answer = kDone;
        }
    } else {
        switch (low) {
            case kReadIo: case kReadId: case kReadId1: case kReadId2:
                if (!mine || (options.old && low >= kReadId1)) return false;
                answer = low == kReadIo ? io() : low == kReadId ? id() : low == kReadId1 ? id1_ : id2_;
                break;
            case kReset:
                if (!mine_inv) return false;
                answer = kAck;
                restart(last, kResetTime);
                break;
            case kReadStatus:
                if (!mine_inv) return false;
                answer = status();
                break;
            default: return false;                   // PRGM, R1, reserved
        }
        requests_++;
    }
    return true;
}

void Slave::answer_pulses(unsigned nibble, int64_t t, std::vector<Pulse> &out) {
    out.clear();
    // every draw is made for every answer, so one fault's setting does not move the others' stream
    const bool silent = random_.chance(faults.p_no_answer), flip = random_.chance(faults.p_parity);
    const bool missing = random_.chance(faults.p_missing_pulse), shifted = random_.chance(faults.p_shifted_pulse);
    const bool extra = random_.chance(faults.p_extra_pulse);
    const uint32_t which_missing = random_.next(), which_shifted = random_.next();
    if (silent) return;
    answers_++;
    const auto pick = [](uint32_t r, size_t n) { return static_cast<size_t>(static_cast<uint64_t>(r) * n >> 32); };
    telegram_pulses(answer_word(nibble) ^ (flip ? 2u : 0u), 7, t, out);
    if (shifted) out[1 + pick(which_shifted, out.size() - 1)].t += faults.shift_ns;  // the first is the time base
    if (missing) out.erase(out.begin() + static_cast<std::ptrdiff_t>(pick(which_missing, out.size())));
    if (extra) out.push_back({t + kAnswerSpan + kHalfBit, kPulseWidth, -1});
}

void Slave::state(asi_slave_state &out) const {
    out.address = static_cast<uint8_t>(number_ + (number_ && sel() ? 32 : 0));
    out.outputs = outputs_;
    out.parameter = parameter_;
    out.dexg_disabled = dexg_disabled_;
    out.synchronous = synchronous_;
    out.present = alive();
    out.status = static_cast<uint8_t>(status());
    out.reserved = 0;
    out.requests = requests_;
    out.answers = answers_;
}

}  // namespace asi

// ------------------------------------------------------------------------------------------------ net
using asi::Listener;
using asi::Pulse;
using asi::Slave;

void asi_net::put(const Pulse &pulse) {
    // two senders with the same polarity look like one longer pulse; merging may make it touch the next one
    Pulse p = pulse;
    for (size_t i = 0; i < queue_.size();) {
        const Pulse &q = queue_[i];
        if (q.polarity == p.polarity && q.t <= p.t + p.width && p.t <= q.t + q.width) {
            const int64_t end = std::max(q.t + q.width, p.t + p.width);
            p.t = std::min(q.t, p.t);
            p.width = static_cast<int32_t>(end - p.t);
            queue_.erase(queue_.begin() + static_cast<std::ptrdiff_t>(i));
            i = 0;
        } else {
            i++;
        }
    }
    // sorted by falling start; at equal starts the positive one comes out first
    const auto at = std::find_if(queue_.begin(), queue_.end(), [&](const Pulse &q) {
        return q.t < p.t || (q.t == p.t && q.polarity > p.polarity);
    });
    queue_.insert(at, p);
}

bool asi_net::take(Pulse &pulse) {
    if (started_.empty()) return false;
    pulse = started_.front();
    started_.pop_front();
    return true;
}

int64_t asi_net::next_event() const {
    const int64_t pulse = queue_.empty() ? asi::kNever : queue_.back().t;
    return std::min({pulse, sync_.due(), async_.due()});
}

void asi_net::event(Listener &view, Listener::Event event, bool synchronous) {
    if (event == Listener::Event::kNone) return;
    const int64_t at = now;
    for (Slave &slave : slaves) {
        slave.catch_up(at);
        if (!slave.hears(view.first(), synchronous)) continue;
        if (event == Listener::Event::kBad) {
            slave.bad_request();
            continue;
        }
        unsigned nibble = 0;
        if (!slave.request(view.call(), at, view.last(), nibble)) continue;
        const int64_t delay = (synchronous ? asi::kAnswerSync : asi::kAnswerAsync) + slave.faults.delay_ns;
        slave.answer_pulses(nibble, std::max(view.last() + delay, at + 1), scratch_);
        for (const Pulse &p : scratch_) put({std::max(p.t, at + 1), p.width, p.polarity});
    }
}

void asi_net::advance_view(Listener &view, int64_t t, bool synchronous) {
    const int64_t due = view.due();
    if (due <= t) now = std::max(now, due);
    event(view, view.advance(t), synchronous);
}

void asi_net::advance(int64_t t) {
    // the synchronous view decides first, both in time and here
    advance_view(sync_, t, true);
    advance_view(async_, t, false);
    for (; !queue_.empty() && queue_.back().t <= t; queue_.pop_back()) {
        monitor.pulse(queue_.back(), false, phase);
        started_.push_back(queue_.back());
    }
    now = std::max(now, t);
}

void asi_net::master_pulse(int64_t t, int32_t polarity) {
    advance(t);
    monitor.pulse({t, asi::kPulseWidth, polarity}, true, phase);
    event(sync_, sync_.pulse(t, polarity), true);
    event(async_, async_.pulse(t, polarity), false);
}

// ------------------------------------------------------------------------------------------------ C interface
namespace {
Slave *find(asi_net *net, int slave) {
    return net && slave >= 0 && static_cast<size_t>(slave) < net->slaves.size()
               ? &net->slaves[static_cast<size_t>(slave)] : nullptr;
}
Slave *transacting(asi_net *net, int slave) {  // only slaves that are more than plain nibbles
    Slave *s = find(net, slave);
    return s && s->transaction ? s : nullptr;
}
constexpr int kBad = -1;
}  // namespace

extern "C" {

asi_net *asi_net_new(uint64_t seed) { return new (std::nothrow) asi_net(seed); }
void asi_net_free(asi_net *net) { delete net; }

int asi_net_add(asi_net *net, const asi_slave_cfg *cfg) {
    if (!net || !cfg || cfg->address > 63 || cfg->address == 32) return kBad;
    if (cfg->address > 32 && cfg->id != 0xA) return kBad;  // only an A/B slave has a B address
    net->slaves.emplace_back(*cfg, net->seed + 0x10001 * (net->slaves.size() + 1), net->now, net->power);
    return static_cast<int>(net->slaves.size()) - 1;
}

int asi_net_set_inputs(asi_net *net, int slave, uint8_t inputs) {
    Slave *s = find(net, slave);
    if (!s || inputs > 15) return kBad;
    s->inputs = inputs;
    return 0;
}

int asi_net_set_present(asi_net *net, int slave, uint8_t present) {
    Slave *s = find(net, slave);
    if (!s) return kBad;
    s->set_present(present != 0, net->now);
    return 0;
}

int asi_net_set_periphery_fault(asi_net *net, int slave, uint8_t fault) {
    Slave *s = find(net, slave);
    if (!s) return kBad;
    s->periphery_fault = fault != 0;
    return 0;
}

int asi_net_set_faults(asi_net *net, int slave, const asi_slave_faults *faults) {
    Slave *s = find(net, slave);
    if (!s || !faults) return kBad;
    s->faults = *faults;
    return 0;
}

int asi_net_set_options(asi_net *net, int slave, const asi_slave_options *options) {
    Slave *s = find(net, slave);
    if (!s || !options || options->write_ns < 0) return kBad;
    const bool serial = s->transaction && s->transaction->set_serial(options->di_swapped, options->busy);
    if (!serial && (options->di_swapped || options->busy)) return kBad;
    s->options = *options;
    return 0;
}

int asi_net_set_value(asi_net *net, int slave, int channel, uint16_t value) {
    Slave *s = transacting(net, slave);
    return s && channel >= 0 && s->transaction->set_value(static_cast<unsigned>(channel), value) ? 0 : kBad;
}

int asi_net_set_invalid(asi_net *net, int slave, uint8_t v0, uint8_t overflow) {
    Slave *s = transacting(net, slave);
    return s && s->transaction->set_invalid(v0, overflow) ? 0 : kBad;
}

int asi_net_get_value(const asi_net *net, int slave, int channel, uint16_t *value) {
    Slave *s = transacting(const_cast<asi_net *>(net), slave);
    if (!s || channel < 0 || !value) return kBad;
    s->catch_up(net->now);
    return s->transaction->value(static_cast<unsigned>(channel), net->now, *value);
}

int asi_net_set_string(asi_net *net, int slave, int kind, const uint8_t *bytes, int n) {
    Slave *s = transacting(net, slave);
    if (!s || kind < 0 || n < 0 || (n > 0 && !bytes)) return kBad;
    return s->transaction->set_string(static_cast<unsigned>(kind), bytes, static_cast<unsigned>(n)) ? 0 : kBad;
}

int asi_net_get_string(const asi_net *net, int slave, int kind, uint8_t *bytes, int max) {
    const Slave *s = transacting(const_cast<asi_net *>(net), slave);
    if (!s || kind < 0 || max < 0 || (max > 0 && !bytes)) return kBad;
    return s->transaction->string(static_cast<unsigned>(kind), bytes, static_cast<unsigned>(max));
}

int asi_net_set_safety(asi_net *net, int slave, const uint8_t table[8], uint8_t closed) {
    Slave *s = transacting(net, slave);
    return s && table && s->transaction->set_safety(table, closed) ? 0 : kBad;
}

int asi_net_get(const asi_net *net, int slave, asi_slave_state *state) {
    Slave *s = find(const_cast<asi_net *>(net), slave);
    if (!s || !state) return kBad;
    s->catch_up(net->now);
    s->state(*state);
    return 0;
}

int asi_net_power(asi_net *net, uint8_t good) {
    if (!net) return kBad;
    net->power = good != 0;
    for (Slave &s : net->slaves) s.set_power(net->power, net->now);
    return 0;
}

int asi_net_master_pulse(asi_net *net, int64_t t_ns, int32_t polarity) {
    if (!net || t_ns < net->now || (polarity != 1 && polarity != -1)) return kBad;
    net->master_pulse(t_ns, polarity);
    return 0;
}

int asi_net_advance(asi_net *net, int64_t t_ns, asi_pulse *out, int max) {
    if (!net || t_ns < net->now || max < 0 || (max > 0 && !out)) return kBad;
    net->advance(t_ns);
    int n = 0;
    for (Pulse p; n < max && net->take(p); n++) out[n] = {p.t, p.width, p.polarity};
    return n;
}

int asi_net_inject(asi_net *net, int64_t t_ns, int32_t polarity, int32_t width_ns) {
    if (!net || t_ns < net->now || width_ns <= 0 || (polarity != 1 && polarity != -1)) return kBad;
    net->put({t_ns, width_ns, polarity});
    return 0;
}

void asi_net_pulse_counts(const asi_net *net, asi_pulse_counts *out) { *out = net->monitor.counts(); }
int asi_net_log(asi_net *net, asi_telegram *out, int max) {
    if (!net || max < 0 || (max > 0 && !out)) return kBad;
    net->monitor.advance(net->now);
    return net->monitor.drain(out, max);
}

}  // extern "C"
