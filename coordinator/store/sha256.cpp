#include "coordinator/store/sha256.hpp"

#include <sodium.h>

#include <array>
#include <bit>
#include <cstddef>

namespace proofmass::coordinator {

struct Sha256::Hash {
  crypto_hash_sha256_state state;
};

Sha256::Sha256() : hash_(std::make_unique<Hash>()) { crypto_hash_sha256_init(&hash_->state); }
Sha256::~Sha256() = default;

void Sha256::add(std::span<const unsigned char> bytes) {
  crypto_hash_sha256_update(&hash_->state, bytes.data(), bytes.size());
}

void Sha256::add(std::uint64_t value) {
  std::array<unsigned char, sizeof(value)> bytes{};
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<unsigned char>(value >> (8 * i));
  }
  add(std::span<const unsigned char>(bytes));
}

// Adding zero takes the sign from a negative zero, which SQLite does not keep.
void Sha256::add(double value) { add(std::bit_cast<std::uint64_t>(value + 0.0)); }

void Sha256::add(std::string_view text) {
  add(std::uint64_t{text.size()});
  add_bytes(text);
}

void Sha256::add_bytes(std::string_view bytes) {
  add(std::span(reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size()));
}

std::string Sha256::finish() {
  std::array<unsigned char, crypto_hash_sha256_BYTES> hash{};
  crypto_hash_sha256_final(&hash_->state, hash.data());
  std::array<char, 2 * crypto_hash_sha256_BYTES + 1> text{};
  sodium_bin2hex(text.data(), text.size(), hash.data(), hash.size());
  return text.data();
}

}  // namespace proofmass::coordinator
