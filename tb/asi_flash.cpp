// SPDX-License-Identifier: Apache-2.0
// asi_flash.cpp: see asi_flash.h. A program or erase takes effect when its time is over, anyhow when power fails first.
#include "asi_flash.h"

#include <stdlib.h>
#include <string.h>

namespace {
constexpr uint8_t kId[2] = {0xEF, 0x40};
enum : uint8_t {
    kProgram = 0x02, kRead = 0x03, kWriteDisable = 0x04, kStatus = 0x05, kWriteEnable = 0x06, kErase = 0x20,
    kReadId = 0x9F, kWake = 0xAB, kSleep = 0xB9, kIgnored = 0x00
};

uint32_t hash(uint32_t x) {
    x = (x ^ x >> 16) * 0x7FEB352Du;
    x = (x ^ x >> 15) * 0x846CA68Bu;
    return x ^ x >> 16;
}
}  // namespace

uint32_t asi_flash::dice() {
    rng ^= rng << 13;
    rng ^= rng >> 17;
    rng ^= rng << 5;
    return rng;
}

void asi_flash::load(uint32_t address, const uint8_t *bytes, uint32_t n) {
    memcpy(cell + address, bytes, n);
    memset(doubt + address, 0, n);
}

/// The operation has ended in time.
void asi_flash::finish() {
    if (op_ == Op::Program) {
        for (uint32_t k = 0; k < kPage; k++) {
            if (!written_[k]) continue;
            cell[op_address_ + k] &= page_[k];
            doubt[op_address_ + k] &= page_[k];
        }
    } else {
        memset(cell + op_address_, 0xFF, kSector);
        memset(doubt + op_address_, 0, kSector);
    }
    wear_out();
    op_ = Op::None;
    latch_ = false;
}

void asi_flash::wear_out() {
    const uint8_t kind = worn[op_address_ / kSector];
    if (kind == 1 && op_ == Op::Erase) cell[op_address_ + 1234] &= 0xFE;
    if (kind == 2 && op_ == Op::Program) cell[op_address_] = 0xFF;
}

/// Power has failed in it. Program: few, half, nearly all or all of the zeros are there; erase: in the preparing write
/// of zeros, anything, nearly blank, blank, or only begun. Cells between 0 and 1 are in doubt.
void asi_flash::tear() {
    const uint32_t how = dice() % (op_ == Op::Program ? 4 : 5);
    const uint32_t n = op_ == Op::Program ? kPage : kSector;
    for (uint32_t k = 0; k < n; k++) {
        if (op_ == Op::Program && !written_[k]) continue;
        const uint32_t r = dice();
        const uint8_t a = uint8_t(r), b = uint8_t(r >> 8), c = uint8_t(r >> 16);
        uint8_t &cells = cell[op_address_ + k], &doubts = doubt[op_address_ + k];
        if (op_ == Op::Program) {
            const uint8_t zeros = uint8_t(cells & ~page_[k]);
            const uint8_t done = uint8_t(how == 0 ? 0 : how == 1 ? zeros & a : zeros);
            const uint8_t open = uint8_t(how == 1 ? zeros & ~a & b : how == 3 ? 0 : zeros & a & b);
            doubts = uint8_t((doubts & ~done) | open);
            cells = uint8_t(cells & ~done);
        } else {
            if (how == 0) cells &= a, doubts = 0;
            if (how == 1) cells = a, doubts = b;
            if (how == 2) cells = 0xFF, doubts = uint8_t(a & b & c);
            if (how == 3) cells = 0xFF, doubts = 0;
            if (how == 4) doubts |= uint8_t(~cells & a & b);
        }
    }
    op_ = Op::None;
}

void asi_flash::settle(int64_t t) {
    if (op_ != Op::None && t >= busy_until_) finish();
    if (deep_ && awake_at_ >= 0 && t >= awake_at_) deep_ = false;
}

/// What goes out with the next byte; does not change anything but by time.
uint8_t asi_flash::answer(int64_t t) {
    if (dead || !taken_) return 0xFF;
    settle(t);
    if (command_ == kStatus) return uint8_t((op_ != Op::None) | latch_ << 1);
    if (command_ == kReadId) {
        const uint32_t k = (taken_ - 1) % 3;
        return k < 2 ? kId[k] : uint8_t(__builtin_ctz(size));
    }
    if (command_ == kRead && taken_ >= 4) {
        const uint32_t a = (address_ + taken_ - 4) & (size - 1);
        return doubt[a] ? uint8_t(cell[a] ^ (doubt[a] & hash(a + 0x9E3779B9u * uint32_t(counts.bytes)))) : cell[a];
    }
    return 0xFF;
}

void asi_flash::take(int64_t t, uint8_t in) {
    if (dead) return;
    settle(t);
    if (taken_ == 0) {
        command_ = in;
        const bool known = in == kProgram || in == kRead || in == kWriteDisable || in == kStatus ||
                           in == kWriteEnable || in == kErase || in == kReadId || in == kWake || in == kSleep;
        if (!known || (deep_ && in != kWake) || (op_ != Op::None && in != kStatus)) command_ = kIgnored;
    } else if (taken_ < 4) {
        address_ = (address_ << 8 | in) & (size - 1);
        if (taken_ == 3) memset(written_, 0, command_ == kProgram ? sizeof written_ : 0);
    } else if (command_ == kProgram) {
        const uint32_t k = (address_ + taken_ - 4) % kPage;
        page_[k] = in;
        written_[k] = true;
    }
    taken_++;
    counts.bytes++;
    if (cut_left > 0 && --cut_left == 0) cut();
}

/// Chip select rises.
void asi_flash::execute(int64_t t) {
    settle(t);
    const bool whole = bit_ == 0;
    bool done = command_ == kRead || command_ == kStatus || command_ == kReadId;
    switch (command_) {
    case kWriteEnable: if ((done = whole && taken_ == 1)) latch_ = true; break;
    case kWriteDisable: if ((done = whole && taken_ == 1)) latch_ = false; break;
    case kSleep: if ((done = whole && taken_ == 1)) deep_ = true, awake_at_ = -1; break;
    case kWake:
        done = whole;
        if (whole && deep_ && awake_at_ < 0) awake_at_ = t + kWakeNs;
        break;
    case kProgram:
        if ((done = whole && taken_ > 4 && latch_)) {
            op_ = Op::Program, op_address_ = address_ & ~(kPage - 1), busy_until_ = t + program_ns;
            counts.programs++;
        }
        break;
    case kErase:
        if ((done = whole && taken_ == 4 && latch_)) {
            op_ = Op::Erase, op_address_ = address_ & ~(kSector - 1), busy_until_ = t + erase_ns;
            counts.erases++;
            erases[op_address_ / kSector]++;
        }
        break;
    default: break;
    }
    if (!done && (taken_ || !whole)) counts.refused++;
}

void asi_flash::select(int64_t t, bool on) {
    if (dead || on == selected_) return;
    if (!on) execute(t);
    selected_ = on, taken_ = 0, bit_ = 0, command_ = kIgnored;
}

uint8_t asi_flash::byte(int64_t t, uint8_t in) {
    if (dead || !selected_) return 0xFF;
    const uint8_t out = answer(t);
    take(t, in);
    return out;
}

int asi_flash::pins(int64_t t, bool cs_n, bool sck, bool mosi) {
    const bool rise = sck && !sck_, fall = !sck && sck_, selects = !cs_n && cs_n_;
    sck_ = sck;
    if (cs_n != cs_n_) {
        cs_n_ = cs_n;
        select(t, !cs_n);
    }
    if (dead || !selected_) return 1;
    if (rise && !selects) {
        shift_in_ = uint8_t(shift_in_ << 1 | mosi);
        bit_ = (bit_ + 1) & 7;
        if (bit_ == 0) take(t, shift_in_);
    }
    if ((selects || fall) && bit_ == 0) shift_out_ = answer(t);
    return dead ? 1 : shift_out_ >> (7 - bit_) & 1;
}

void asi_flash::cut() {
    cut_left = -1;
    if (op_ != Op::None) tear();
    dead = true;
}

void asi_flash::power_up() {
    if (!dead && op_ != Op::None) tear();
    dead = selected_ = latch_ = sck_ = false;
    deep_ = cs_n_ = true;
    awake_at_ = -1;
    busy_until_ = 0, taken_ = 0, bit_ = 0, shift_out_ = 0xFF, command_ = kIgnored;
    cut_left = -1;
}

extern "C" {

asi_flash *asi_flash_new(uint32_t bytes) {
    if (bytes < 0x10000 || bytes > 0x1000000 || (bytes & (bytes - 1))) return nullptr;
    void *memory = calloc(1, sizeof(asi_flash) + 2 * size_t(bytes) + 5 * size_t(bytes / asi_flash::kSector));
    if (!memory) return nullptr;
    static_assert(sizeof(asi_flash) % alignof(uint32_t) == 0);
    asi_flash *f = static_cast<asi_flash *>(memory);
    const asi_flash fresh;  // no placement new: that is the C++ library's
    memcpy(static_cast<void *>(f), static_cast<const void *>(&fresh), sizeof fresh);
    f->size = bytes;
    f->erases = reinterpret_cast<uint32_t *>(f + 1);
    f->cell = reinterpret_cast<uint8_t *>(f->erases + bytes / asi_flash::kSector);
    f->doubt = f->cell + bytes;
    f->worn = f->doubt + bytes;
    memset(f->cell, 0xFF, bytes);
    f->power_up();
    return f;
}
void asi_flash_free(asi_flash *flash) { free(flash); }

static bool outside(const asi_flash *flash, uint32_t address, uint32_t n) {
    return address > flash->size || n > flash->size - address;
}
int asi_flash_load(asi_flash *flash, uint32_t address, const uint8_t *bytes, uint32_t n) {
    if (outside(flash, address, n)) return -1;
    flash->load(address, bytes, n);
    return 0;
}
int asi_flash_peek(const asi_flash *flash, uint32_t address, uint8_t *bytes, uint32_t n) {
    if (outside(flash, address, n)) return -1;
    memcpy(bytes, flash->cell + address, n);
    return 0;
}
int asi_flash_doubt(const asi_flash *flash, uint32_t address, uint8_t *bytes, uint32_t n) {
    if (outside(flash, address, n)) return -1;
    memcpy(bytes, flash->doubt + address, n);
    return 0;
}
void asi_flash_copy(asi_flash *to, const asi_flash *from) {
    const asi_flash own = *to;
    const size_t sectors = from->size / asi_flash::kSector;
    *to = *from;
    to->cell = own.cell, to->doubt = own.doubt, to->worn = own.worn, to->erases = own.erases;
    memcpy(to->cell, from->cell, from->size);
    memcpy(to->doubt, from->doubt, from->size);
    memcpy(to->worn, from->worn, sectors);
    memcpy(to->erases, from->erases, 4 * sectors);
}
void asi_flash_times(asi_flash *flash, int64_t program_ns, int64_t erase_ns) {
    flash->program_ns = program_ns, flash->erase_ns = erase_ns;
}
void asi_flash_cut_after(asi_flash *flash, int64_t bytes, uint32_t seed) {
    flash->rng = seed ? seed : 1;
    flash->cut_left = bytes;
    if (bytes == 0) flash->cut();
}
int asi_flash_is_dead(const asi_flash *flash) { return flash->dead; }
void asi_flash_power_up(asi_flash *flash) { flash->power_up(); }
int asi_flash_worn(asi_flash *flash, uint32_t address, int kind) {
    if (address >= flash->size || kind < 0 || kind > 2) return -1;
    flash->worn[address / asi_flash::kSector] = uint8_t(kind);
    return 0;
}
void asi_flash_get_counts(const asi_flash *flash, asi_flash_counts *counts) { *counts = flash->counts; }
uint32_t asi_flash_erases(const asi_flash *flash, uint32_t address) {
    return address < flash->size ? flash->erases[address / asi_flash::kSector] : 0;
}
void asi_flash_select(asi_flash *flash, int64_t t_ns, int on) { flash->select(t_ns, on != 0); }
uint8_t asi_flash_byte(asi_flash *flash, int64_t t_ns, uint8_t out) { return flash->byte(t_ns, out); }
int asi_flash_pins(asi_flash *flash, int64_t t_ns, int cs_n, int sck, int mosi) {
    return flash->pins(t_ns, cs_n != 0, sck != 0, mosi != 0);
}

}  // extern "C"
