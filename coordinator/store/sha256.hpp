#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace proofmass::coordinator {

/// SHA-256 of numbers and texts that are added one after the other, each in a fixed binary layout.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;

  void add(std::span<const unsigned char> bytes);
  void add_bytes(std::string_view bytes);  ///< Without their number.
  void add(std::uint64_t value);           ///< 8 bytes, lowest first.
  void add(double value);                  ///< Its bits, lowest byte first; a zero has no sign.
  void add(std::string_view text);         ///< Its size as 64 bits, then its bytes.

  /// 64 hexadecimal digits. @pre Called once, at the end.
  [[nodiscard]] std::string finish();

 private:
  struct Hash;
  std::unique_ptr<Hash> hash_;
};

}  // namespace proofmass::coordinator
