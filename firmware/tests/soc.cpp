// SPDX-License-Identifier: Apache-2.0
/// @file soc.cpp  See soc.h. Every access takes two clocks (request, then ready with data), as in synchronous memory.
#include "soc.h"
#include <cstring>
#include <memory>
#include <utility>
#include "VVexRiscv.h"
#include "asi_host.h"
#include "asi_regs.h"
#include "verilated.h"

namespace {
constexpr uint32_t kClocksPerUs = 16;
std::unique_ptr<VerilatedContext> context;
std::unique_ptr<VVexRiscv> cpu;
uint32_t ram[16384], rom[256], window[4096], link_ram[256], stats[1024], ring[512];
soc_state s;
const uint8_t *flash;
uint32_t flash_base, flash_bytes, flash_byte, flash_address, spi_data;
uint8_t flash_command;
bool asleep;
uint64_t woke;
uint32_t dice = 1;

void write_masked(uint32_t &word, uint32_t data, uint32_t be) {
    uint32_t mask = 0;
    for (int k = 0; k < 4; k++) if (be >> k & 1) mask |= 0xFFu << 8 * k;
    word = (word & ~mask) | (data & mask);
}

/// READ 03 and the bytes behind it; anything else is swallowed
void flash_shift(uint32_t out) {
    spi_data = 0xFF;
    if (!(s.spi_ctrl & 1)) return;
    if (flash_byte == 0) flash_command = uint8_t(out);
    else if (flash_byte < 4) flash_address = flash_address << 8 | out;
    else if (flash_command == 3) {
        const uint32_t a = (flash_address++ & 0xFFFFFF) - flash_base;
        if (a < flash_bytes) spi_data = flash[a];
    }
    flash_byte++;
}

uint32_t reg_read(uint32_t offset) {
    switch (offset) {
    case offsetof(asi_regs_t, ID): return 0x41530001;
    case offsetof(asi_regs_t, CTRL): return s.ctrl;
    case offsetof(asi_regs_t, STATUS): return s.status;
    case offsetof(asi_regs_t, EVENT): return s.event;
    case offsetof(asi_regs_t, EVENT_EN): return s.event_en;
    case offsetof(asi_regs_t, TIME): return uint32_t(s.clocks / kClocksPerUs + s.skipped_us);
    case offsetof(asi_regs_t, EXEC): return s.exec;
    case offsetof(asi_regs_t, WAIT): return s.event & s.event_en;
    case offsetof(asi_regs_t, SPI_DATA): return spi_data;
    case offsetof(asi_regs_t, SPI_CTRL): return s.spi_ctrl & 1;
    case offsetof(asi_regs_t, LATCH): return s.latch;
    case offsetof(asi_regs_t, MONITOR): return s.ring_head | s.ring_lost << 16;
    case offsetof(asi_regs_t, CLOCK): return kClocksPerUs;
    default: s.bad_accesses++; return 0;
    }
}

void reg_write(uint32_t offset, uint32_t data) {
    switch (offset) {
    case offsetof(asi_regs_t, CTRL): s.ctrl = data; break;
    case offsetof(asi_regs_t, BATCH):
        s.batches++;
        if (s.status & 3) s.batch_while_busy++;
        s.batch_len = data;
        s.status |= 1;
        break;
    case offsetof(asi_regs_t, EVENT): s.event &= ~data; break;
    case offsetof(asi_regs_t, EVENT_EN): s.event_en = data; break;
    case offsetof(asi_regs_t, EXEC): s.exec = data; break;
    case offsetof(asi_regs_t, HOST_IRQ): s.host_irqs += data & 1; break;
    case offsetof(asi_regs_t, LATCH): s.latch &= ~data; break;
    case offsetof(asi_regs_t, MONITOR_CTRL):
        s.monitor_ctrl = data;
        if (data & 2) s.ring_head = s.ring_lost = 0;  // with tail 0: empty
        break;
    case offsetof(asi_regs_t, SPI_DATA): flash_shift(data & 255); break;
    case offsetof(asi_regs_t, SPI_CTRL):
        if (data & ~s.spi_ctrl & 1) { s.flash_selects++; flash_byte = 0; flash_address = 0; }
        s.spi_ctrl = data & 1;
        break;
    default: s.bad_accesses++;
    }
}

/// Published state, FLAGS to IN_IMG, CDI to PECHO without PCD and PP, combined transactions, history and log, may
/// change only while IN_SEQ is odd; 16-bit values only as a whole.
void check_published(uint32_t offset, uint32_t be) {
    const bool lists = offset >= offsetof(asi_host_t, FLAGS) && offset < offsetof(asi_host_t, IN_SEQ);
    const bool image = offset >= offsetof(asi_host_t, IN_IMG) && offset < offsetof(asi_host_t, OUT_IMG);
    const bool codes = (offset >= offsetof(asi_host_t, CDI) && offset < offsetof(asi_host_t, PCD)) ||
                       (offset >= offsetof(asi_host_t, PI) && offset < offsetof(asi_host_t, LINE_FAULTS));
    const bool analog = offset >= offsetof(asi_host_t, AIDI) && offset < offsetof(asi_host_t, AODI);
    const bool combined = offset >= offsetof(asi_host_t, CTT_STATE) && offset < offsetof(asi_host_t, AIDI);
    const bool safe = offset >= offsetof(asi_host_t, SAFE_IN) && offset < offsetof(asi_host_t, FN_SEQ);
    const bool history = (offset >= offsetof(asi_host_t, CHANGED_SLAVES) && offset <= offsetof(asi_host_t, LOG_HEAD)) ||
                         (offset >= offsetof(asi_host_t, LOG) && offset < offsetof(asi_host_t, STAT));
    const bool open = window[offsetof(asi_host_t, MAGIC) / 4] != 0;
    if (!open) return;
    if ((lists || image || codes || analog || combined || safe || history) &&
        !(window[offsetof(asi_host_t, IN_SEQ) / 4] & 1)) s.seq_violations++;
    if (analog && be != 3 && be != 12 && be != 15) s.torn_writes++;
    s.analog_writes += analog, s.combined_writes += combined, s.safe_writes += safe;
}

uint32_t bus_read(uint32_t a) {
    if (a < sizeof ram) return ram[a / 4];
    if (a >> 10 == 0x10000000u >> 10) return rom[(a & 0x3FF) / 4];
    if (a >> 14 == 0x40000000u >> 14) return window[(a & 0x3FFF) / 4];
    if (a >> 12 == 0x80020000u >> 12) return stats[(a & 0xFFF) / 4];
    if (a >> 12 == 0x80021000u >> 12) return std::exchange(stats[(a & 0xFFF) / 4], 0);
    if (a >> 11 == 0x80030000u >> 11) return ring[(a & 0x7FF) / 4];
    if (a >> 10 == 0x80010000u >> 10) return link_ram[(a & 0x3FF) / 4];
    if (a >> 8 == 0x80000000u >> 8) return reg_read(a & 0xFF);
    s.bad_accesses++;
    return 0;
}

void bus_write(uint32_t a, uint32_t data, uint32_t be) {
    if (a < sizeof ram) write_masked(ram[a / 4], data, be);
    else if (a >> 14 == 0x40000000u >> 14) {
        check_published(a & 0x3FFF, be);
        write_masked(window[(a & 0x3FFF) / 4], data, be);
    }
    else if (a >> 10 == 0x80010000u >> 10 && be == 15) link_ram[(a & 0x3FF) / 4] = data;
    else if (a >> 8 == 0x80000000u >> 8 && be == 15) reg_write(a & 0xFF, data);
    else s.bad_accesses++;
}

void tick() {
    cpu->clk = 0;
    cpu->externalInterruptArray = (s.event & s.event_en) != 0;
    cpu->eval();
    cpu->clk = 1;
    cpu->eval();
    s.clocks++;
    if (s.shake_bytes) {  // a host that writes at every clock
        dice = dice >> 1 ^ (dice & 1 ? 0xA3000000u : 0u);
        for (uint32_t k = 0; k < s.shake_bytes / 4; k++) window[s.shake_address / 4 + k] = dice & 1 ? ~0u : 0u;
    }
    // ready answers a request that was already there in the clock before
    const bool i = cpu->iBusWishbone_CYC && cpu->iBusWishbone_STB && !cpu->iBusWishbone_ACK;
    const bool d = cpu->dBusWishbone_CYC && cpu->dBusWishbone_STB && !cpu->dBusWishbone_ACK;
    const uint32_t daddr = uint32_t(cpu->dBusWishbone_ADR) << 2;
    const bool wait = d && !cpu->dBusWishbone_WE && daddr == 0x80000000u + offsetof(asi_regs_t, WAIT);
    const bool was_asleep = asleep;
    asleep = wait && !(s.event & s.event_en);
    if (asleep && !was_asleep && woke && s.clocks - woke > s.awake_max) s.awake_max = uint32_t(s.clocks - woke);
    if (was_asleep && !asleep) woke = s.clocks;
    cpu->iBusWishbone_ACK = i;
    if (i) cpu->iBusWishbone_DAT_MISO = bus_read(uint32_t(cpu->iBusWishbone_ADR) << 2);
    cpu->dBusWishbone_ACK = d && !asleep;
    if (d && !asleep) {
        if (cpu->dBusWishbone_WE) bus_write(daddr, cpu->dBusWishbone_DAT_MOSI, cpu->dBusWishbone_SEL);
        else cpu->dBusWishbone_DAT_MISO = bus_read(daddr);
    }
}
}  // namespace

int soc_open(uint32_t reset_vector, const uint8_t *flash_data, uint32_t base, uint32_t bytes) {
    cpu.reset();  // before the context it lives in
    context = std::make_unique<VerilatedContext>();
    cpu = std::make_unique<VVexRiscv>(context.get());
    std::memset(&s, 0, sizeof s);
    std::memset(rom, 0, sizeof rom);
    // memories wake up with anything in them
    std::memset(ram, 0xA5, sizeof ram);
    std::memset(window, 0xA5, sizeof window);
    std::memset(link_ram, 0xA5, sizeof link_ram);
    std::memset(stats, 0, sizeof stats);  // the chip clears it
    std::memset(ring, 0xA5, sizeof ring);
    flash = flash_data, flash_base = base, flash_bytes = bytes, flash_byte = 0;
    asleep = false, woke = 0;
    cpu->externalResetVector = reset_vector;
    cpu->reset = 1;
    for (int k = 0; k < 8; k++) tick();
    cpu->reset = 0;
    return 0;
}

uint32_t *soc_ram(void) { return ram; }
uint32_t *soc_rom(void) { return rom; }
uint32_t *soc_window(void) { return window; }
uint32_t *soc_link(void) { return link_ram; }
uint32_t *soc_stats() { return stats; }
uint32_t *soc_ring() { return ring; }
soc_state *soc_regs(void) { return &s; }

int soc_run(uint32_t max_clocks) {
    for (uint32_t k = 0; k < max_clocks; k++) {
        tick();
        if (asleep) return 1;
    }
    return 0;
}

void soc_clocks(uint32_t clocks) {
    for (uint32_t k = 0; k < clocks; k++) tick();
}
