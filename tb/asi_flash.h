// SPDX-License-Identifier: Apache-2.0
/// @file asi_flash.h  SPI NOR flash model, behind asi_flash of asi_tb.h. Uses the C library only, so that the native
/// tests of the firmware link it without a C++ run time. Its twin: cocotb_tests/models/flash.py. Requirement: NV-008.
#ifndef ASI_TB_FLASH_H
#define ASI_TB_FLASH_H
#include "asi_tb.h"

struct asi_flash {
    static constexpr uint32_t kSector = 4096, kPage = 256;
    static constexpr int64_t kWakeNs = 30'000;  // tRES1

    uint8_t *cell = nullptr, *doubt = nullptr, *worn = nullptr;  // worn: per sector
    uint32_t *erases = nullptr;                                  // per sector
    uint32_t size = 0;

    void load(uint32_t address, const uint8_t *bytes, uint32_t n);
    void select(int64_t t, bool on);
    uint8_t byte(int64_t t, uint8_t in);
    int pins(int64_t t, bool cs_n, bool sck, bool mosi);
    void cut();
    void power_up();

    int64_t program_ns = 400'000, erase_ns = 45'000'000, cut_left = -1;
    uint32_t rng = 1;
    bool dead = false;
    asi_flash_counts counts = {};

private:
    enum class Op : uint8_t { None, Program, Erase };
    uint32_t dice();
    void settle(int64_t t);
    void finish();
    void tear();
    void wear_out();
    uint8_t answer(int64_t t);
    void take(int64_t t, uint8_t in);
    void execute(int64_t t);

    // volatile state
    bool selected_ = false, latch_ = false, deep_ = true;
    bool sck_ = false, cs_n_ = true;
    Op op_ = Op::None;
    uint8_t command_ = 0, shift_in_ = 0, shift_out_ = 0xFF, bit_ = 0;
    uint32_t taken_ = 0, address_ = 0, op_address_ = 0;  // taken_: bytes of this frame
    int64_t busy_until_ = 0, awake_at_ = 0;
    uint8_t page_[kPage] = {};
    bool written_[kPage] = {};
};
#endif
