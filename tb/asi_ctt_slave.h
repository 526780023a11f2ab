// SPDX-License-Identifier: Apache-2.0
// asi_ctt_slave.h: combined transactions and safety words as a slave speaks them, at nibble level (SL-009).
//
// One Transaction per slave whose codes ask for one (CT-001); plain slaves, and members of a CTT5 group, which exchange
// plain nibbles, have none. Constants: rdl/ctt.toml. Times in ns. A slave never knows whether its answer was heard:
// whatever has no control bit or selector of its own counts two calls within the hold time as one, repeated.
#pragma once
#include <cstdint>
#include <memory>

namespace asi {

class Transaction {
public:
    // By IO, ID and ID2 code; null: plain nibbles.
    static std::unique_ptr<Transaction> make(unsigned io, unsigned id, unsigned id2);
    virtual ~Transaction() = default;

    virtual void reset() = 0;  // power-up, RES, watchdog; what the plant side has set stays
    // An accepted DEXG: I3..I0 as on the line; `plain` is what a plain slave would answer. -> answer I3..I0
    virtual unsigned exchange(unsigned call, unsigned plain, int64_t t) = 0;
    virtual void parameter(unsigned, int64_t) {}  // an accepted WPAR

    // The plant side; false or a negative number: this kind of slave has no such thing, and nothing changed.
    virtual bool set_value(unsigned, uint16_t) { return false; }
    virtual bool set_invalid(unsigned, unsigned) { return false; }        // bit per channel: V = 0, O = 1
    virtual int value(unsigned, int64_t, uint16_t &) { return -1; }       // 1: received, 0: none yet
    virtual bool set_string(unsigned, const uint8_t *, unsigned) { return false; }
    virtual int string(unsigned, uint8_t *, unsigned) const { return -1; }  // -> bytes; -1 also: does not fit
    virtual bool set_safety(const uint8_t *, unsigned) { return false; }
    virtual bool set_serial(bool, unsigned) { return false; }  // DI2, DI3 swapped; requests refused as busy
};

}  // namespace asi
