// SPDX-License-Identifier: Apache-2.0
// asi_line.h: what slaves and monitor both need to know about the line: times in ns, pulses, telegram words.
// Times are measured from pulse start to pulse start. Requirements: TL-001..TL-005, RX-003, RX-004.
#pragma once
#include <cstdint>
#include <vector>

namespace asi {

constexpr int64_t kHalfBit = 3'000, kBit = 6'000;           // pulse grid, bit time
constexpr int64_t kWinEarly = 875, kWinLate = 1'500;        // a pulse may start this early or late (P_WIN_*)
constexpr int64_t kRequestSpan = 13 * kBit;                 // first to last pulse of a request
constexpr int64_t kAnswerSpan = 6 * kBit;
constexpr int32_t kPulseWidth = 1'500;                      // comparator pulse on the line

constexpr uint8_t kControl = 1;                             // CB = 1: a command

struct Pulse {
    int64_t t;         // start
    int32_t width;
    int32_t polarity;  // -1 or +1
};

inline unsigned parity(unsigned word) { return static_cast<unsigned>(__builtin_parity(word)); }

// The answer word ST I3..I0 PB EB of a nibble.
inline unsigned answer_word(unsigned nibble) { return nibble << 2 | parity(nibble) << 1 | 1; }

// The pulses of a telegram word, first one at t: a pulse per bit, '-' for 0 and '+' for 1, and between two equal
// bits one of the other polarity.
inline void telegram_pulses(unsigned word, int bits, int64_t t, std::vector<Pulse> &out) {
    out.clear();
    for (int k = bits - 1; k >= 0; k--, t += kBit) {
        const int polarity = word >> k & 1 ? 1 : -1;
        out.push_back({t, kPulseWidth, polarity});
        if (k > 0 && (word >> k & 1) == (word >> (k - 1) & 1)) out.push_back({t + kHalfBit, kPulseWidth, -polarity});
    }
}

// Which window n (centre n * 3 us) a pulse d ns after the first one belongs to; -1: none, it is in the dead zone.
inline int window_of(int64_t d) {
    const int64_t n = (d + kWinEarly) / kHalfBit;
    return d - n * kHalfBit <= kWinLate ? static_cast<int>(n) : -1;
}

}  // namespace asi
