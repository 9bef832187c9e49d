#include "core/random/stream.hpp"

#include "tests/test.hpp"

namespace proofmass {
namespace {

// Known answers of philox4x32 with 10 rounds, published with [Salmon2011] (Random123, kat_vectors).
TEST(Philox, GivesThePublishedAnswers) {
  EXPECT_EQ(philox({0, 0, 0, 0}, 0), (RandomBlock{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  EXPECT_EQ(philox({0xffffffff, 0xffffffff, 0xffffffff, 0xffffffff}, 0xffffffffffffffff),
            (RandomBlock{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  // Digits of π; the key's first word is the low one.
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, 0x299f31d0a4093822),
            (RandomBlock{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

// From the test vectors of the algorithm's authors (draft-eastlake-fnv).
TEST(StreamId, IsThePublishedHash) {
  EXPECT_EQ(stream_id(""), 0x811c9dc5U);
  EXPECT_EQ(stream_id("a"), 0xe40c292cU);
  EXPECT_EQ(stream_id("b"), 0xe70c2de5U);
  EXPECT_EQ(stream_id("foo"), 0xa9f37ed7U);
  EXPECT_EQ(stream_id("foobar"), 0xbf9cf968U);
}

// A byte above 127 must not be extended by its sign: (offset ^ 0xff)·prime mod 2³².
TEST(StreamId, TakesBytesAsUnsigned) {
  EXPECT_EQ(stream_id("\xff"), (0x811c9dc5U ^ 0xffU) * 0x01000193U);
}

TEST(RandomStream, IsPhiloxOfBlockNameRunAndSeed) {
  const RandomStream stream(0x0123456789abcdef, RunIndex{0x1122334455667788}, 0xcafe);
  EXPECT_EQ(stream.block(7), philox({7, 0xcafe, 0x55667788, 0x11223344}, 0x0123456789abcdef));
}

TEST(Uniform, LiesOnCentresOf52BitCells) {
  EXPECT_EQ(uniform({0, 0, 0, 0}), 0x1p-53);
  EXPECT_EQ(uniform({0xfff, 0, 0, 0}), 0x1p-53);  // The lowest twelve bits fall away.
  EXPECT_EQ(uniform({0x1000, 0, 0, 0}), 0x3p-53);
  EXPECT_EQ(uniform({0, 1, 0, 0}), 0x1p-32 + 0x1p-53);
  EXPECT_EQ(uniform({0, 0x80000000, 0, 0}), 0.5 + 0x1p-53);
  EXPECT_EQ(uniform({0xffffffff, 0x7fffffff, 0, 0}), 0.5 - 0x1p-53);
  EXPECT_EQ(uniform({0xffffffff, 0xffffffff, 0, 0}), 1.0 - 0x1p-53);
}

}  // namespace
}  // namespace proofmass
