#include "coordinator/net/request_parts.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <variant>

namespace proofmass::coordinator {
namespace {

using wire::RequestPart;

constexpr TimePoint start{};

std::uint64_t next_offset(const RequestParts::Outcome& outcome) {
  return std::get<wire::PartReply>(outcome).next_offset;
}

TEST(RequestParts, MakeARequestWhole) {
  RequestParts parts;
  EXPECT_EQ(next_offset(parts.take("a", 1, {6, 0, "abc"}, start)), 3U);
  EXPECT_EQ(parts.size_held(), 6U);
  const auto outcome = parts.take("a", 1, {6, 3, "def"}, start);
  EXPECT_EQ(std::get<RequestParts::Whole>(outcome).bytes, "abcdef");
  EXPECT_EQ(parts.size_held(), 6U);  // Until it has been read.
  parts.release(6);
  EXPECT_EQ(parts.size_held(), 0U);
}

TEST(RequestParts, OfSeveralConnectionsMayInterleave) {
  RequestParts parts;
  (void)parts.take("a", 1, {4, 0, "ab"}, start);
  (void)parts.take("b", 1, {4, 0, "wx"}, start);
  EXPECT_EQ(std::get<RequestParts::Whole>(parts.take("a", 1, {4, 2, "cd"}, start)).bytes, "abcd");
  EXPECT_EQ(std::get<RequestParts::Whole>(parts.take("b", 1, {4, 2, "yz"}, start)).bytes, "wxyz");
}

TEST(RequestParts, OutOfOrderAreAskedForAgain) {
  RequestParts parts;
  EXPECT_EQ(next_offset(parts.take("a", 1, {6, 3, "def"}, start)), 0U);
  EXPECT_EQ(next_offset(parts.take("a", 1, {6, 0, "ab"}, start)), 2U);
  EXPECT_EQ(next_offset(parts.take("a", 1, {6, 0, "ab"}, start)), 2U);  // Repeated.
  EXPECT_EQ(next_offset(parts.take("a", 1, {6, 4, "ef"}, start)), 2U);  // One is missing.
  const auto outcome = parts.take("a", 1, {6, 2, "cdef"}, start);
  EXPECT_EQ(std::get<RequestParts::Whole>(outcome).bytes, "abcdef");
}

TEST(RequestParts, OfAnotherRequestTakeThePlaceOfTheFirst) {
  RequestParts parts;
  (void)parts.take("a", 1, {100, 0, "abc"}, start);
  EXPECT_EQ(next_offset(parts.take("a", 2, {10, 0, "xyz"}, start)), 3U);
  EXPECT_EQ(parts.size_held(), 10U);
  EXPECT_EQ(next_offset(parts.take("a", 1, {100, 3, "def"}, start)), 0U);
  // The same number with another size is another request.
  EXPECT_EQ(next_offset(parts.take("a", 2, {12, 0, "x"}, start)), 1U);
  EXPECT_EQ(parts.size_held(), 12U);
}

TEST(RequestParts, TakeNoMoreMemoryThanTheyMay) {
  RequestParts parts(10);
  (void)parts.take("a", 1, {6, 0, "a"}, start);
  const auto refused = parts.take("b", 1, {5, 0, "b"}, start);
  EXPECT_EQ(std::get<wire::ErrorReply>(refused).text,
            "request size = 5 bytes (the coordinator is receiving 6 bytes of others, at most 10 "
            "together: try again later)");
  EXPECT_EQ(next_offset(parts.take("b", 1, {4, 0, "b"}, start)), 1U);
  // A whole one counts until it has been read.
  (void)parts.take("b", 1, {4, 1, "bcd"}, start);
  EXPECT_TRUE(std::holds_alternative<wire::ErrorReply>(parts.take("c", 1, {1, 0, "c"}, start)));
  parts.release(4);
  EXPECT_TRUE(std::holds_alternative<RequestParts::Whole>(parts.take("c", 1, {1, 0, "c"}, start)));
}

// Room is counted with the first part of a request.
TEST(RequestParts, Take128MebibytesUnlessToldOtherwise) {
  constexpr std::uint64_t half = std::uint64_t{64} << 20;
  RequestParts parts;
  EXPECT_EQ(next_offset(parts.take("a", 1, {half, 0, "a"}, start)), 1U);
  EXPECT_EQ(next_offset(parts.take("b", 1, {half, 0, "b"}, start)), 1U);
  EXPECT_TRUE(std::holds_alternative<wire::ErrorReply>(parts.take("c", 1, {1, 0, "c"}, start)));
}

TEST(RequestParts, ThatDoNotComeAreWaitedForHalfAMinute) {
  RequestParts parts;
  (void)parts.take("a", 1, {6, 0, "abc"}, start);
  (void)parts.take("b", 1, {6, 0, "abc"}, start + std::chrono::seconds(20));
  parts.drop_stale(start + std::chrono::seconds(31));
  EXPECT_EQ(parts.size_held(), 6U);
  EXPECT_EQ(next_offset(parts.take("a", 1, {6, 3, "def"}, start)), 0U);
}

}  // namespace
}  // namespace proofmass::coordinator
