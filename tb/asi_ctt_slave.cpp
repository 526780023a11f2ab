// SPDX-License-Identifier: Apache-2.0
#include "asi_ctt_slave.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <vector>

#include "asi_ctt_table.h"

namespace asi {
namespace {

constexpr int64_t kLongAgo = std::numeric_limits<int64_t>::min() / 2;
constexpr int64_t kHold = ASI_SAFETY_WORD_HOLD_US * INT64_C(1'000);

unsigned reversed(unsigned triple) { return (triple & 1) << 2 | (triple & 2) | triple >> 2; }

// A call within the hold time of an answered one is its repetition; every answered call starts the time anew.
class Repetition {
public:
    void reset() { last_ = kLongAgo; }
    bool operator()(int64_t t) {
        const bool repeated = t - last_ < kHold;
        last_ = t;
        return repeated;
    }

private:
    int64_t last_ = kLongAgo;
};

int copy(const std::vector<uint8_t> &from, uint8_t *to, unsigned max) {
    if (from.size() > max) return -1;
    std::copy(from.begin(), from.end(), to);
    return static_cast<int>(from.size());
}

// ---------------------------------------------------------------------------------------------- CTT1
// The receiver of the data names the triple it wants. Inputs and strings that are read: call {control, number}, answer
// {control, triple}. Outputs and strings that are written: call {control, triple}, answer {control, wanted number}.
// A call whose control bit has been served already takes nothing and begins nothing; it is answered all the same.
class Ctt1 : public Transaction {
public:
    // triples: of a value with its E triple; less than 7: the value left-aligned in what is there. strings: by the
    // parameter that S-7.4 leaves to the master. supervised: P0 = 1 drops outputs when the dialogue stops (S-7.3).
    Ctt1(bool inputs, unsigned channels, unsigned triples, bool strings, bool supervised)
        : inputs_(inputs), channels_(channels), triples_(triples), strings_(strings), supervised_(supervised) {
        reset();
    }

    void reset() override {
        mode_ = Mode::kData;
        parameter_ = ASI_CTT1_PAR_DATA;
        served_ = !ASI_CTT1_START_TOGGLE;  // so the F of the activation is not a triple
        accepted_at_ = kNone;
        have_ = 0;
        begin_mode();
    }

    unsigned exchange(unsigned call, unsigned, int64_t t) override {
        if (ASI_CTT1_INVERT_OUT) call ^= 15;
        const unsigned control = call >> ASI_CTT1_TOGGLE_POS & 1, bits = ASI_CTT1_TOGGLE_POS ? call & 7 : call >> 1;
        catch_up(t);
        const bool fresh = control != served_;
        served_ = control;
        if (fresh) accepted_at_ = t;
        unsigned payload;
        if (!receiving()) {
            payload = in_order(give(number_of(bits), fresh));
        } else {
            if (fresh && !lost_) take(in_order(bits));
            if (fresh) lost_ = false;
            payload = number_of(wanted_);
        }
        const unsigned echo = control ^ ASI_CTT1_ECHO_INVERTED;
        return ASI_CTT1_TOGGLE_POS ? echo << 3 | payload : payload << 1 | echo;
    }

    void parameter(unsigned value, int64_t t) override {
        catch_up(t);
        parameter_ = value;
        const Mode mode = !strings_ ? Mode::kData : value == ASI_CTT1_PAR_ID ? Mode::kId
                          : value == ASI_CTT1_PAR_DIAG ? Mode::kDiagnosis : value == ASI_CTT1_PAR_RD ? Mode::kRead
                          : value == ASI_CTT1_PAR_WR ? Mode::kWrite : Mode::kData;
        if (mode == mode_) return;  // a repeated WPAR disturbs nothing
        mode_ = mode;
        begin_mode();  // the control bit goes on alternating
    }

    bool set_value(unsigned channel, uint16_t value) override {
        if (!inputs_ || channel >= channels_) return false;
        values_[channel] = value;
        return true;
    }
    bool set_invalid(unsigned invalid, unsigned overflow) override {
        if (!inputs_ || (invalid | overflow) >> channels_) return false;
        invalid_ = invalid;
        overflow_ = overflow;
        return true;
    }
    int value(unsigned channel, int64_t now, uint16_t &out) override {
        if (inputs_ || channel >= channels_) return -1;
        catch_up(now);
        if (!(have_ >> channel & 1)) return 0;
        out = values_[channel];
        return 1;
    }
    bool set_string(unsigned kind, const uint8_t *bytes, unsigned n) override {
        if (!strings_ || kind >= texts_.size() || n > ASI_CTT1_STRING_BYTES) return false;
        texts_[kind].assign(bytes, bytes + n);
        texts_[kind].resize((n + 2) / 3 * 3);  // whole sequences
        return true;
    }
    int string(unsigned kind, uint8_t *bytes, unsigned max) const override {
        return strings_ && kind < texts_.size() ? copy(texts_[kind], bytes, max) : -1;
    }

private:
    enum class Mode { kData, kId, kDiagnosis, kRead, kWrite };
    static constexpr int64_t kNone = std::numeric_limits<int64_t>::max();
    static constexpr int64_t kSilence = ASI_CTT1_SLAVE_TIMEOUT_MS * INT64_C(1'000'000);
    static constexpr unsigned kV = 1, kO = 2, kF = 2;  // last two bits of a value, of a sequence

    // Here triples are counted down to 0; on the line as the table says. Payload bits as the table orders them.
    static unsigned number_of(unsigned triple) { return ASI_CTT1_COUNT_UP ? 7 - triple : triple; }
    static unsigned in_order(unsigned triple) { return ASI_CTT1_MSB_LEFT ? triple : reversed(triple); }
    static unsigned channel_of(unsigned e) { return ASI_CTT1_E_REVERSED ? reversed(e) : e; }
    bool receiving() const { return mode_ == Mode::kWrite || (mode_ == Mode::kData && !inputs_); }
    unsigned top() const { return (mode_ == Mode::kData ? triples_ : ASI_CTT1_SEQUENCE_TRIPLES) - 1; }
    unsigned e_shift() const { return 3 * (triples_ - 1); }
    unsigned missing_bits() const { return 3 * (ASI_CTT1_VALUE_TRIPLES - triples_); }
    const std::vector<uint8_t> &text() const {
        return texts_[mode_ == Mode::kId ? 0 : mode_ == Mode::kDiagnosis ? 1 : 2];
    }

    void begin_mode() {
        begun_ = complete_ = lost_ = false;
        turn_ = 0;
        wanted_ = top();
        frame_ = 0;
        received_.clear();
    }

    // After such a silence the master may have begun anew, and has no way to say so: ask for the first triple, and do
    // not take the next one, which may be any.
    void catch_up(int64_t t) {
        if (accepted_at_ == kNone || t - accepted_at_ < kSilence) return;
        accepted_at_ = kNone;
        wanted_ = top();
        lost_ = true;
        if (supervised_ && parameter_ & 1) have_ = 0;
    }

    // Sending. The first number begins a frame: the next one when the last was complete, else the same anew.
    unsigned give(unsigned number, bool fresh) {
        if (number == top() && (fresh || !begun_)) {
            if (complete_) turn_ = (turn_ + 1) % (mode_ == Mode::kData ? channels_ : std::max(1u, sequences()));
            begun_ = true;
            complete_ = false;
            frame_ = mode_ == Mode::kData ? value_frame(turn_) : sequence_frame(turn_);
        }
        if (!begun_ || number > top()) return 0;  // the F of an activation, or a dialogue from before: V = 0
        complete_ |= number == 0;
        return frame_ >> 3 * number & 7;
    }
    unsigned value_frame(unsigned channel) const {
        const bool valid = !(invalid_ >> channel & 1), overflow = overflow_ >> channel & 1;
        const unsigned head = channel_of(channel) << e_shift() | values_[channel] >> missing_bits() << 2;
        return head | (overflow ? kO : 0) | (valid ? kV : 0);
    }
    unsigned sequences() const { return static_cast<unsigned>(text().size()) / 3; }
    unsigned sequence_frame(unsigned n) const {
        if (n >= sequences()) return 0;  // no such string: V = 0
        const uint8_t *b = text().data() + 3 * n;
        return b[0] << 16 | b[1] << 8 | (b[2] & ~3u) | (n + 1 < sequences() ? kF : 0) | kV;
    }

    void take(unsigned triple) {
        frame_ = wanted_ == top() ? triple : frame_ << 3 | triple;
        if (wanted_) {
            wanted_--;
            return;
        }
        wanted_ = top();
        if (mode_ == Mode::kWrite) take_sequence(); else take_value();
    }
    void take_value() {
        const unsigned channel = channel_of(frame_ >> e_shift() & 7);
        if (!(frame_ & kV) || channel >= channels_) return;
        values_[channel] = static_cast<uint16_t>(frame_ >> 2 << missing_bits());
        have_ |= 1u << channel;
    }
    void take_sequence() {
        if (!(frame_ & kV)) {
            received_.clear();
            return;
        }
        if (received_.size() <= ASI_CTT1_STRING_BYTES) {  // one sequence more says that it is too long
            for (const unsigned shift : {16u, 8u, 0u}) received_.push_back(static_cast<uint8_t>(frame_ >> shift));
        }
        if (frame_ & kF) return;
        if (received_.size() <= ASI_CTT1_STRING_BYTES) texts_[2] = received_;
        received_.clear();
    }

    const bool inputs_;
    const unsigned channels_, triples_;
    const bool strings_, supervised_;
    // plant side
    std::array<uint16_t, 4> values_{};
    unsigned invalid_ = 0, overflow_ = 0, have_ = 0;
    std::array<std::vector<uint8_t>, 3> texts_;  // ID, diagnosis, parameters
    // dialogue
    Mode mode_;
    unsigned parameter_, served_;
    int64_t accepted_at_;        // last call with a new control bit
    bool begun_, complete_;      // sending: there is a frame; all of it has been asked for
    bool lost_;                  // receiving: the next triple is not taken
    unsigned turn_, wanted_, frame_;
    std::vector<uint8_t> received_;
};

// ---------------------------------------------------------------------------------------------- CTT2
// Clock and data both ways, a bit in two calls. Both move on with every call that is not a repetition, so an answer
// that was lost does not lose a clock level. A master that gives up on a call loses one; the gap brings both together.
class Ctt2 : public Transaction {
public:
    Ctt2() {
        objects_[0] = {0, 0, 0, 0, 0x22};  // nobody's; one word each way
        reset();
    }

    void reset() override {
        repetition_.reset();
        last_call_ = 0;
        levels_ = ASI_CTT2_IDLE;
        clock_ = ASI_CTT2_IDLE & 1;
        quiet_calls_ = 0;
        clear();
        reply({});
        have_ = 0;
    }

    unsigned exchange(unsigned call, unsigned plain, int64_t t) override {
        const bool repeated = repetition_(t) && call == last_call_;
        last_call_ = call;
        if (!repeated) {
            receive(call >> ASI_CTT2_DO_CLOCK & 1, call >> ASI_CTT2_DO_DATA & 1);
            levels_ = next_levels();
        }
        const unsigned clock = levels_ & 1, data = levels_ >> 1;
        constexpr unsigned kLines = 1u << ASI_CTT2_DI_CLOCK | 1u << ASI_CTT2_DI_DATA;
        return (plain & ~kLines) | (swapped_ ? data : clock) << ASI_CTT2_DI_CLOCK
               | (swapped_ ? clock : data) << ASI_CTT2_DI_DATA;
    }

    bool set_value(unsigned channel, uint16_t value) override {
        if (channel >= inputs_.size()) return false;
        inputs_[channel] = value;
        return true;
    }
    int value(unsigned channel, int64_t, uint16_t &out) override {
        if (channel >= outputs_.size()) return -1;
        if (!(have_ >> channel & 1)) return 0;
        out = outputs_[channel];
        return 1;
    }
    bool set_string(unsigned index, const uint8_t *bytes, unsigned n) override {
        if (index > 255 || n > 255) return false;
        objects_[index].assign(bytes, bytes + n);
        return true;
    }
    int string(unsigned index, uint8_t *bytes, unsigned max) const override {
        const auto object = objects_.find(index);
        return object == objects_.end() ? -1 : copy(object->second, bytes, max);
    }

    bool set_serial(bool swapped, unsigned busy) override {
        swapped_ = swapped;
        busy_ = busy;
        return true;
    }

private:
    using Bytes = std::vector<uint8_t>;
    enum Code : unsigned { kGetCyclic = 0x00, kPutCyclic = 0x01, kRead = 0x10, kWrite = 0x11, kDeviceRead = 0x12,
                           kDeviceWrite = 0x13, kExchange = 0x1D, kGood = 0x40, kError = 0x80 };
    enum Error : uint8_t { kIllegalIndex = 1, kIllegalLength = 2, kNotImplemented = 3, kBusy = 4 };
    static constexpr size_t kLongest = 4 + 255;  // by its length byte; more than is legal
    static constexpr size_t kUnknown = std::numeric_limits<size_t>::max();

    // Sending: clock in bit 0, data in bit 1. Half 1 of a bit is before the active edge, half 2 behind it.
    unsigned next_levels() {
        if (half_ == 16 * out_.size()) reply({});
        if (out_.empty()) return ASI_CTT2_IDLE;
        const size_t n = half_++;
        const unsigned place = n / 2 % 8, bit = out_[n / 16] >> (ASI_CTT2_MSB_FIRST ? 7 - place : place) & 1;
        return bit << 1 | ((n & 1) == ASI_CTT2_RISING_EDGE);
    }
    void reply(Bytes bytes) {  // begins with the answer to this call
        out_ = std::move(bytes);
        half_ = 0;
    }

    void receive(unsigned clock, unsigned data) {
        if (clock == clock_) {
            if (++quiet_calls_ >= ASI_CTT2_GAP_CALLS) gap();
            return;
        }
        quiet_calls_ = 0;
        clock_ = clock;
        if (clock != ASI_CTT2_RISING_EDGE) return;
        byte_ = ASI_CTT2_MSB_FIRST ? byte_ << 1 | data : byte_ >> 1 | data << 7;
        if (++bits_ < 8) return;
        bits_ = 0;
        if (in_.size() < kLongest) in_.push_back(static_cast<uint8_t>(byte_));
        if (in_.size() == length()) {
            serve();
            clear();
        }
    }
    void gap() {
        // Only a gap ends a request whose length nobody knows. What is below kRead is cyclic and has no error response,
        // what begins at kGood is a response itself.
        if (!in_.empty() && !known(in_[0]) && in_[0] >= kRead && in_[0] < kGood) refuse(kNotImplemented);
        clear();
    }
    void clear() {
        in_.clear();
        bits_ = byte_ = 0;
    }

    static bool known(unsigned code) {
        return code <= kPutCyclic || (code >= kRead && code <= kDeviceWrite) || code == kExchange;
    }
    size_t length() const {
        switch (in_[0]) {
            case kGetCyclic: return 1;
            case kPutCyclic: return 1 + image_bytes(4);
            case kRead: case kDeviceRead: return 3;
            case kWrite: case kDeviceWrite: return in_.size() < 3 ? kUnknown : 3u + in_[2];
            case kExchange: return in_.size() < 4 ? kUnknown : 4u + in_[3];
            default: return kUnknown;
        }
    }
    // Bytes of an image, from the I/O configuration byte of the ID object: outputs in bit 6..4, inputs in 2..0.
    size_t image_bytes(unsigned shift) const {
        constexpr std::array<uint8_t, 8> kBytes = {0, 1, 2, 4, 6, 8, 0, 0};
        const auto id = objects_.find(0);
        return id == objects_.end() || id->second.size() < 5 ? 0 : kBytes[id->second[4] >> shift & 7];
    }

    void refuse(Error error) { reply({static_cast<uint8_t>(in_[0] + kError), error}); }
    void serve() {
        if (in_[0] == kGetCyclic) get_cyclic();
        else if (in_[0] == kPutCyclic) put_cyclic();
        else acyclic();
    }
    void get_cyclic() {  // words high byte first; an image of one byte is the low byte of the first word
        const size_t n = image_bytes(0);
        Bytes bytes;
        for (size_t i = 0; i < n; i++) {
            bytes.push_back(static_cast<uint8_t>(inputs_[i / 2] >> (n > 1 && i % 2 == 0 ? 8 : 0)));
        }
        reply(std::move(bytes));
    }
    void put_cyclic() {
        const size_t n = in_.size() - 1;
        for (size_t i = 0; i < n; i += 2) {
            outputs_[i / 2] = static_cast<uint16_t>(n == 1 ? in_[1] : in_[1 + i] << 8 | in_[2 + i]);
            have_ |= 1u << i / 2;
        }
    }
    void acyclic() {
        const unsigned code = in_[0];
        const bool exchange = code == kExchange, write = exchange || code == kWrite || code == kDeviceWrite;
        const bool read = exchange || !write;
        const size_t n_read = read ? in_[2] : 0, header = exchange ? 4 : 3, n_write = in_.size() - header;
        if (busy_) {
            busy_--;
            return refuse(kBusy);
        }
        const auto object = objects_.find(in_[1]);
        if (object == objects_.end() || (write && in_[1] == 0)) return refuse(kIllegalIndex);  // nobody writes the ID
        Bytes &bytes = object->second;
        // objects have a length of their own: written whole, read from the beginning
        const bool too_long = in_.size() > ASI_CTT2_MESSAGE_BYTES || n_read + 1 > ASI_CTT2_MESSAGE_BYTES;
        if (too_long || n_read > bytes.size() || (write ? n_write != bytes.size() : n_read == 0)) {
            return refuse(kIllegalLength);
        }
        std::copy_n(in_.begin() + static_cast<std::ptrdiff_t>(header), n_write, bytes.begin());
        Bytes answer = {static_cast<uint8_t>(code + kGood)};
        answer.insert(answer.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(n_read));
        reply(std::move(answer));
    }

    Repetition repetition_;
    unsigned last_call_, levels_, clock_, quiet_calls_, bits_, byte_;
    Bytes in_, out_;
    size_t half_;  // of out_, half bits sent
    bool swapped_ = false;
    unsigned busy_ = 0;
    std::array<uint16_t, 4> inputs_{}, outputs_{};
    unsigned have_;
    std::map<unsigned, Bytes> objects_;  // by index; 0 is the ID object
};

// ---------------------------------------------------------------------------------------------- CTT3
// S-7.A.7: I2 says which two of the four outputs a call carries. Inputs are plain.
class Ctt3FourOutputs : public Transaction {
public:
    Ctt3FourOutputs() { reset(); }
    void reset() override { upper_seen_ = have_ = false; }

    unsigned exchange(unsigned call, unsigned plain, int64_t) override {
        const unsigned pair = (call ^ (ASI_CTT3_INVERT_OUT ? 3u : 0u)) & 3;
        if (call & 4) {
            upper_ = pair;
        } else if (upper_seen_) {  // falling edge of I2: all four together
            outputs_ = upper_ << 2 | pair;
            have_ = true;
        }
        upper_seen_ = call & 4;
        return plain;
    }
    int value(unsigned channel, int64_t, uint16_t &out) override {
        if (channel) return -1;
        if (have_) out = static_cast<uint16_t>(outputs_);
        return have_;
    }

private:
    bool upper_seen_, have_;
    unsigned upper_ = 0, outputs_ = 0;
};

// S-7.A.A: the slave's answer names a packet; the master's next call carries the output pair of that packet, and in I2
// the packet's lower bit as a receipt. Without the receipt the slave sends the packet again.
class Ctt3EightOutputs : public Transaction {
public:
    Ctt3EightOutputs() { reset(); }
    void reset() override {
        begun_ = have_ = false;
        packet_ = 0;
        assembled_ = 0;
    }

    unsigned exchange(unsigned call, unsigned, int64_t) override {
        if (begun_ && (call >> 2 & 1) == ((packet_ & 1) ^ ASI_CTT3_AA_INVERTED)) {
            const unsigned pair = (packet_ + ASI_CTT3_AA_OFFSET) & 3;
            const unsigned bits = (call ^ (ASI_CTT3_INVERT_OUT ? 3u : 0u)) & 3;
            assembled_ = (assembled_ & ~(3u << 2 * pair)) | bits << 2 * pair;
            if (pair == 3) {
                outputs_ = assembled_;
                have_ = true;
            }
            packet_ = (packet_ + 1) & 3;
            if (packet_ == 0) latched_ = inputs_;  // the four packets are of one byte
        } else if (!begun_) {
            latched_ = inputs_;
        }
        begun_ = true;
        return packet_ << 2 | (latched_ >> 2 * packet_ & 3);
    }
    bool set_value(unsigned channel, uint16_t value) override {
        if (channel || value > 255) return false;
        inputs_ = value;
        return true;
    }
    int value(unsigned channel, int64_t, uint16_t &out) override {
        if (channel) return -1;
        if (have_) out = static_cast<uint16_t>(outputs_);
        return have_;
    }

private:
    bool begun_, have_;
    unsigned packet_, assembled_, outputs_ = 0, inputs_ = 0, latched_ = 0;
};

// ---------------------------------------------------------------------------------------------- CTT4
// Placeholder of the table: call I1 I0 = number of a nibble, the answer is that nibble of the channel's word.
class Ctt4 : public Transaction {
public:
    explicit Ctt4(bool two_channels) : two_channels_(two_channels) { reset(); }
    void reset() override {
        latched_ = values_;
        have_ = false;
    }

    unsigned exchange(unsigned call, unsigned, int64_t) override {
        const unsigned bit = call >> ASI_CTT4_CHANNEL_BIT & 1, channel = two_channels_ ? bit : 0, number = call & 3;
        if (!two_channels_) {
            output_ = bit;
            have_ = true;
        }
        if (number == ASI_CTT4_NIBBLES - 1) latched_[channel] = values_[channel];
        return latched_[channel] >> 4 * number & 15;
    }
    bool set_value(unsigned channel, uint16_t value) override {
        if (channel > two_channels_) return false;
        values_[channel] = value;
        return true;
    }
    int value(unsigned channel, int64_t, uint16_t &out) override {
        if (channel || two_channels_) return -1;
        if (have_) out = static_cast<uint16_t>(output_);
        return have_;
    }

private:
    const bool two_channels_;
    std::array<uint16_t, 2> values_{}, latched_{};
    bool have_;
    unsigned output_ = 0;
};

// ---------------------------------------------------------------------------------------------- safety
// The next word of the slave's table with each call that is not a repetition; an open channel forces its two bits to 0.
class Safety : public Transaction {
public:
    void reset() override {
        repetition_.reset();
        word_ = 7;  // the first word comes next
    }
    unsigned exchange(unsigned, unsigned, int64_t t) override {
        if (!repetition_(t)) word_ = (word_ + 1) & 7;
        return table_[word_] & ((closed_ & 1 ? 3u : 0u) | (closed_ & 2 ? 12u : 0u));
    }
    bool set_safety(const uint8_t *table, unsigned closed) override {
        if (closed > 3 || std::any_of(table, table + 8, [](uint8_t word) { return word > 15; })) return false;
        std::copy_n(table, 8, table_.begin());
        closed_ = closed;
        return true;
    }

private:
    Repetition repetition_;
    unsigned word_ = 7, closed_ = 3;
    std::array<uint8_t, 8> table_ = {0b0001, 0b0101, 0b0110, 0b1001, 0b1110, 0b1011, 0b1100, 0b0111};
};

}  // namespace

std::unique_ptr<Transaction> Transaction::make(unsigned io, unsigned id, unsigned id2) {
    if (id == 0xB) return std::make_unique<Safety>();
    if (io == 0xB && id == 0xA && id2 == 5) return std::make_unique<Ctt2>();
    if (io != 7) return nullptr;
    switch (id) {
        case 1: case 2: case 3: case 4: {
            if (id == 4 && id2 == 0) return nullptr;  // S-7.4 in its 4I/4O mode
            constexpr std::array<uint8_t, 4> kChannels = {1, 2, 4, 4};
            const unsigned triples = id == 1   ? ASI_CTT1_TRIPLES_71
                                     : id == 2 ? ASI_CTT1_TRIPLES_72 : ASI_CTT1_VALUE_TRIPLES;
            return std::make_unique<Ctt1>(id2 >> 3 & 1, kChannels[id2 & 3], triples, id == 4, id == 3);
        }
        case 5:
            if (id2 == 5) return std::make_unique<Ctt2>();
            return nullptr;
        case 0xA:
            if (id2 == 5) return std::make_unique<Ctt2>();
            if (id2 == 7) return std::make_unique<Ctt3FourOutputs>();
            if (id2 == 0xA) return std::make_unique<Ctt3EightOutputs>();
            if (ASI_CTT4_ENABLE && (id2 == 8 || id2 == 9)) return std::make_unique<Ctt4>(id2 == 9);
            return nullptr;
        default: return nullptr;
    }
}

}  // namespace asi
