// SPDX-License-Identifier: Apache-2.0
// asi_chip.cpp: the Verilated asi_master with simulated slaves on its pins. Behind asi_chip of asi_tb.h.
//
// One time rule for every pin: what happens at time t (a pulse of a slave, an own transmit edge) is on the pins right
// after the first clock edge that is not before t, so the chip samples it with the next one. A clock costs one
// evaluation, one comparison of the watched outputs and one of the next event's clock; everything else happens only
// when one of them says so.
// Requirements: RX-012 (the chip hears itself), LT-* are measured on these pins.
#include <verilated.h>
#ifndef VM_TRACE
#define VM_TRACE 0
#endif
#if VM_TRACE_FST
#include <verilated_fst_c.h>
using WaveFile = VerilatedFstC;
#elif VM_TRACE_VCD
#include <verilated_vcd_c.h>
using WaveFile = VerilatedVcdC;
#endif

#include <algorithm>
#include <cstdio>
#include <memory>
#include <new>
#include <string>

#include "Vasi_master.h"
#include "Vasi_master___024root.h"
#include "asi_flash.h"
#include "asi_slaves.h"

#ifndef ASI_CLK_HZ
#error "ASI_CLK_HZ: the ClkHz the model was built with"
#endif

namespace {
constexpr int64_t kMhz = ASI_CLK_HZ / 1'000'000;
static_assert(ASI_CLK_HZ % 8'000'000 == 0, "the clock is a whole multiple of 8 MHz");
constexpr uint64_t kNoClock = ~0ull;
constexpr int kResetClocks = 8;
constexpr int kHostWaitMax = 10'000;  // clocks; the bus contract promises a few
constexpr uint8_t kFirstCyclePhase = 3;  // DATA_EXCHANGE: from here on cycles follow each other

int64_t time_of(uint64_t clock) { return static_cast<int64_t>(clock) * 1'000 / kMhz; }
// The design has one clock and rising-edge logic only, so a clock without a new input is exactly one pass over the
// model's clocked logic. Calling that pass directly, and telling the model that it saw the clock low when inputs did
// change, is three times as fast as evaluating both edges. The names are Verilator's own: should they ever be missing
// (or with waves, which want to show a clock), both edges are evaluated through the public interface.
template <class Root> constexpr bool kDirect = requires(Root root) {
    root.__Vtrigprevexpr___TOP__clk_i__0 = 0;
    root.__VnbaTriggered[0] = 1;
};
constexpr bool kOneEdge = kDirect<Vasi_master___024root> && !VM_TRACE;
template <class Root> void edge(Vasi_master &top, Root &root, bool inputs_changed) {
    if (inputs_changed) {
        root.__Vtrigprevexpr___TOP__clk_i__0 = 0;
        top.eval();
    } else {
        root.__VnbaTriggered[0] = 1;
        Vasi_master___024root___eval_nba(&root);
        root.__VnbaTriggered[0] = 0;
    }
}

uint64_t clock_of(int64_t t) {  // first clock not before t
    return t == asi::kNever ? kNoClock : static_cast<uint64_t>((t * kMhz + 999) / 1'000);
}
}  // namespace

struct asi_chip {
    asi_chip(const char *firmware, const char *wave, uint64_t seed);
    ~asi_chip();
    void step();
    void run_until(uint64_t clock, bool stop_on_irq);
    uint32_t host(bool write, uint32_t byte_addr, uint32_t data, uint8_t byte_enable);
    void attach(asi_flash *flash);
    void schedule();
    void get_stats(asi_chip_stats &out);

    VerilatedContext context;
    std::unique_ptr<Vasi_master> top;
    asi_net net;
    uint64_t clock = 0;  // clock edges since the end of reset
    bool inputs_changed = true;  // since the last evaluation: combinational paths from inputs are stale

private:
    struct Watched {  // outputs that make something happen when they change
        uint8_t man = 1, en = 0, phase = 0, sync = 0, wait = 0, cs_n = 1, sck = 0;
        bool operator==(const Watched &) const = default;
    };
    Watched sample() const {
        return {top->tx_man_o,    top->tx_en_o,   top->phase_o, top->sync_o,
                top->core_wait_o, top->spi_cs_no, top->spi_sck_o};
    }
    void outputs_changed(const Watched &next);
    void spi_changed(const Watched &next);
    void event();
    void raise(int32_t polarity, uint64_t until);
    void dump(bool high);

    Watched seen_;
    asi_flash *flash_ = nullptr;
    uint64_t next_event_ = kNoClock;
    uint64_t p_until_ = kNoClock, n_until_ = kNoClock;  // clock at which the comparator output falls
    uint64_t phase_since_ = 0, phase_clocks_[8] = {};
    uint64_t cycle_at_ = kNoClock, cycles_ = 0, periods_ = 0, cycle_min_ = kNoClock, cycle_max_ = 0, cycle_sum_ = 0;
    uint64_t busy_since_ = kNoClock, irq_count_ = 0, irq_max_ = 0, irq_max_cycle_ = 0;
    bool busy_in_cycle_ = false;  // cycles were running when the core woke
#if VM_TRACE
    std::unique_ptr<WaveFile> wave_;
#endif
};

asi_chip::asi_chip(const char *firmware, const char *wave, uint64_t seed) : net(seed) {
    const std::string plusarg = std::string("+firmware=") + (firmware ? firmware : "");
    const char *args[] = {"asi_chip", plusarg.c_str()};
    context.commandArgs(firmware ? 2 : 1, args);
    context.timeunit(-9);
    context.timeprecision(-12);
#if VM_TRACE
    if (wave) context.traceEverOn(true);
#endif
    top = std::make_unique<Vasi_master>(&context, "TOP");
#if VM_TRACE
    if (wave) {
        wave_ = std::make_unique<WaveFile>();
        top->trace(wave_.get(), 99);
        wave_->open(wave);
    }
#else
    (void)wave;
#endif
    top->clk_i = 0;
    top->rst_i = 1;
    top->rx_p_i = top->rx_n_i = 0;
    top->apf_ni = 1;
    top->efault_i = 0;
    top->spi_miso_i = 1;
    top->host_req_i = top->host_we_i = 0;
    top->host_be_i = 0;
    top->host_addr_i = 0;
    top->host_wdata_i = 0;
    top->eval();
    for (int i = 0; i < 2 * kResetClocks; i++) {
        top->clk_i = !top->clk_i;
        top->eval();
    }
    top->rst_i = 0;
    top->clk_i = 1;  // the first edge without reset is time 0
    top->eval();
    seen_ = sample();
    net.phase = seen_.phase;
    dump(true);
    schedule();
}

asi_chip::~asi_chip() {
    Verilated::threadContextp(&context);  // the model signs off at the thread's context, whichever chip that was
#if VM_TRACE
    if (wave_) wave_->close();
    wave_.reset();
#endif
    top->final();
    top.reset();
    Verilated::threadContextp(Verilated::defaultContextp());  // this one goes
}

void asi_chip::dump(bool high) {
#if VM_TRACE
    // in ps; the low half is half a clock before edge `clock`
    if (wave_) wave_->dump((2 * clock - (high ? 0 : 1)) * (500'000 / kMhz));
#else
    (void)high;
#endif
}

void asi_chip::schedule() {
    next_event_ = std::min({clock_of(net.next_event()), p_until_, n_until_});
}

void asi_chip::raise(int32_t polarity, uint64_t until) {
    uint64_t &end = polarity > 0 ? p_until_ : n_until_;
    end = end == kNoClock ? until : std::max(end, until);
    (polarity > 0 ? top->rx_p_i : top->rx_n_i) = 1;
    inputs_changed = true;
}

void asi_chip::event() {
    const int64_t t = time_of(clock);
    if (p_until_ <= clock) { p_until_ = kNoClock; top->rx_p_i = 0; inputs_changed = true; }
    if (n_until_ <= clock) { n_until_ = kNoClock; top->rx_n_i = 0; inputs_changed = true; }
    net.advance(t);
    for (asi::Pulse p; net.take(p);) raise(p.polarity, clock_of(p.t + p.width));
    schedule();
}

void asi_chip::spi_changed(const Watched &next) {
    seen_.cs_n = next.cs_n, seen_.sck = next.sck;
    if (!flash_) return;
    const uint8_t miso = static_cast<uint8_t>(flash_->pins(time_of(clock), next.cs_n, next.sck, top->spi_mosi_o));
    inputs_changed |= miso != top->spi_miso_i;
    top->spi_miso_i = miso;
}

void asi_chip::attach(asi_flash *flash) {
    Verilated::threadContextp(&context);
    flash_ = flash;
    top->spi_miso_i = 1;
    inputs_changed = true;
    if (!flash) return;
    flash->power_up();
    if (!seen_.cs_n) spi_changed(seen_);  // the chip is in the middle of a frame
}

void asi_chip::outputs_changed(const Watched &next) {
    if (next.cs_n != seen_.cs_n || next.sck != seen_.sck) spi_changed(next);
    if (next == seen_) return;
    const int64_t t = time_of(clock);
    if (next.man != seen_.man && (next.en || seen_.en)) {
        const int32_t polarity = next.man ? 1 : -1;
        net.master_pulse(t, polarity);
        raise(polarity, clock_of(t + asi::kPulseWidth));
        schedule();
    }
    if (next.phase != seen_.phase) {
        phase_clocks_[seen_.phase & 7] += clock - phase_since_;
        phase_since_ = clock;
        net.phase = next.phase;
        if (next.phase < kFirstCyclePhase) cycle_at_ = kNoClock;
    }
    if (next.sync && !seen_.sync) {
        cycles_++;
        if (cycle_at_ != kNoClock) {
            const uint64_t period = clock - cycle_at_;
            periods_++;
            cycle_sum_ += period;
            cycle_min_ = std::min(cycle_min_, period);
            cycle_max_ = std::max(cycle_max_, period);
        }
        cycle_at_ = clock;
    }
    if (next.wait != seen_.wait) {
        if (!next.wait) {
            busy_since_ = clock;
            busy_in_cycle_ = next.phase >= kFirstCyclePhase;
        } else if (busy_since_ != kNoClock) {  // the start-up code before the first WAIT is not an interrupt
            irq_count_++;
            irq_max_ = std::max(irq_max_, clock - busy_since_);
            if (busy_in_cycle_ && next.phase >= kFirstCyclePhase)
                irq_max_cycle_ = std::max(irq_max_cycle_, clock - busy_since_);
        }
    }
    seen_ = next;
}

inline void asi_chip::step() {
    clock++;
    if constexpr (kOneEdge) {
        edge(*top, *top->rootp, inputs_changed);
        inputs_changed = false;
    } else {
        top->clk_i = 0;
        top->eval();
        dump(false);
        top->clk_i = 1;
        top->eval();
        dump(true);
    }
    const Watched next = sample();
    if (next != seen_) [[unlikely]] outputs_changed(next);
    if (clock >= next_event_) [[unlikely]] event();
}

void asi_chip::run_until(uint64_t until, bool stop_on_irq) {
    Verilated::threadContextp(&context);
    schedule();  // the caller may have changed the slaves
    if (stop_on_irq) {
        while (clock < until && !top->host_irq_o) step();
    } else {
        while (clock < until) step();
    }
    net.advance(time_of(clock));
}

uint32_t asi_chip::host(bool write, uint32_t byte_addr, uint32_t data, uint8_t byte_enable) {
    Verilated::threadContextp(&context);
    schedule();
    top->host_req_i = 1;
    top->host_we_i = write;
    top->host_addr_i = byte_addr >> 2 & 0xFFF;
    top->host_be_i = byte_enable & 15;
    top->host_wdata_i = data;
    top->eval();  // no edge: the clock is high already
    for (int i = 0; i < kHostWaitMax && !top->host_ready_o; i++) step();
    const uint32_t result = top->host_ready_o ? top->host_rdata_o : 0xFFFF'FFFF;
    step();  // the edge that takes the data
    top->host_req_i = top->host_we_i = 0;
    top->eval();
    net.advance(time_of(clock));
    return result;
}

void asi_chip::get_stats(asi_chip_stats &out) {
    const auto ns = [](uint64_t clocks) { return time_of(clocks); };
    net.monitor.advance(time_of(clock));
    out = {};
    out.clocks = clock;
    out.telegrams = net.monitor.telegrams;
    out.repeated = net.monitor.repeated;
    out.failed = net.monitor.failed;
    for (int i = 0; i < 8; i++)
        out.phase_ns[i] = ns(phase_clocks_[i] + (i == (seen_.phase & 7) ? clock - phase_since_ : 0));
    out.cycles = cycles_;
    out.cycle_periods = periods_;
    out.cycle_min_ns = periods_ ? ns(cycle_min_) : 0;
    out.cycle_max_ns = ns(cycle_max_);
    out.cycle_sum_ns = ns(cycle_sum_);
    out.irq_count = irq_count_;
    out.irq_clocks_max = irq_max_;
    out.irq_clocks_max_cycle = irq_max_cycle_;
}

extern "C" {

asi_chip *asi_chip_new(const char *firmware_path, const char *wave_path, uint64_t seed) {
#if !VM_TRACE
    if (wave_path) return nullptr;
#endif
    for (const auto &[path, mode] : {std::pair{firmware_path, "r"}, std::pair{wave_path, "w"}}) {
        if (!path) continue;
        std::FILE *file = std::fopen(path, mode);  // the simulator itself would end the process
        if (!file) return nullptr;
        std::fclose(file);
    }
    return new (std::nothrow) asi_chip(firmware_path, wave_path, seed);
}
void asi_chip_free(asi_chip *chip) { delete chip; }
asi_net *asi_chip_net(asi_chip *chip) { return &chip->net; }
uint32_t asi_chip_clk_hz(const asi_chip *) { return ASI_CLK_HZ; }
int64_t asi_chip_time(const asi_chip *chip) { return time_of(chip->clock); }
int64_t asi_chip_run(asi_chip *chip, int64_t until_ns) {
    chip->run_until(clock_of(std::max<int64_t>(until_ns, 0)), false);
    return time_of(chip->clock);
}
int64_t asi_chip_run_irq(asi_chip *chip, int64_t until_ns) {
    chip->run_until(clock_of(std::max<int64_t>(until_ns, 0)), true);
    return time_of(chip->clock);
}
uint32_t asi_chip_host_read(asi_chip *chip, uint32_t byte_addr) { return chip->host(false, byte_addr, 0, 15); }
void asi_chip_host_write(asi_chip *chip, uint32_t byte_addr, uint32_t data, uint8_t byte_enable) {
    chip->host(true, byte_addr, data, byte_enable);
}
void asi_chip_apf(asi_chip *chip, uint8_t low) {
    chip->top->apf_ni = !low;
    chip->inputs_changed = true;
}
void asi_chip_efault(asi_chip *chip, uint8_t fault) {
    chip->top->efault_i = fault != 0;
    chip->inputs_changed = true;
}
void asi_chip_attach_flash(asi_chip *chip, asi_flash *flash) { chip->attach(flash); }
int asi_chip_log(asi_chip *chip, asi_telegram *out, int max) { return asi_net_log(&chip->net, out, max); }
void asi_chip_get_stats(asi_chip *chip, asi_chip_stats *out) { chip->get_stats(*out); }

}  // extern "C"
