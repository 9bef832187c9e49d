#pragma once

#include <sodium.h>

#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

namespace proofmass::coordinator {

/// SHA-256 of numbers and texts that are added one after the other, each in a fixed binary layout.
class Sha256 {
 public:
  Sha256() { crypto_hash_sha256_init(&state_); }

  /// All of its bytes, lowest first.
  template <std::unsigned_integral Integer>
  void add(Integer value) {
    if (num_waiting_ + sizeof(value) > waiting_.size()) flush();
    for (std::size_t i = 0; i < sizeof(value); ++i) {
      waiting_[num_waiting_ + i] = static_cast<unsigned char>(value >> (8 * i));
    }
    num_waiting_ += sizeof(value);
  }
  /// Its bits, lowest byte first. Adding zero takes the sign from a negative zero, which SQLite
  /// does not keep.
  void add(double value) { add(std::bit_cast<std::uint64_t>(value + 0.0)); }
  void add(std::string_view text) {  ///< Its size as 64 bits, then its bytes.
    add(std::uint64_t{text.size()});
    add_bytes(text);
  }
  void add_bytes(std::string_view bytes) {  ///< Without their number.
    flush();
    crypto_hash_sha256_update(&state_, reinterpret_cast<const unsigned char*>(bytes.data()),
                              bytes.size());
  }

  /// 64 hexadecimal digits. @pre Called once, at the end.
  [[nodiscard]] std::string finish() {
    flush();
    std::array<unsigned char, crypto_hash_sha256_BYTES> hash{};
    crypto_hash_sha256_final(&state_, hash.data());
    std::array<char, 2 * crypto_hash_sha256_BYTES + 1> text{};
    return sodium_bin2hex(text.data(), text.size(), hash.data(), hash.size());
  }

 private:
  void flush() {
    crypto_hash_sha256_update(&state_, waiting_.data(), num_waiting_);
    num_waiting_ = 0;
  }

  crypto_hash_sha256_state state_{};
  std::array<unsigned char, 512> waiting_{};  ///< Numbers: a call for each would take longer.
  std::size_t num_waiting_ = 0;
};

}  // namespace proofmass::coordinator
