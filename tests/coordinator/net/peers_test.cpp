#include "coordinator/net/peers.hpp"

#include <gtest/gtest.h>

#include "proto/proofmass.pb.h"

namespace proofmass::coordinator {
namespace {

using wire::SessionId;
using wire::WorkerId;

Address at(const std::string& routing_id, const std::string& key = "") {
  return {.routing_id = routing_id, .key = key, .host = {}};
}

TEST(Peers, GiveEachSessionAWorkerOfItsOwn) {
  Peers peers;
  EXPECT_EQ(peers.meet({11}, 1, at("a")), WorkerId{1});
  EXPECT_EQ(peers.meet({12}, 1, at("b")), WorkerId{2});
  EXPECT_EQ(peers.meet({11}, 2, at("a")), WorkerId{1});
  EXPECT_EQ(peers.session_of({2}), SessionId{12});
  EXPECT_EQ(peers.worker_of({12}), WorkerId{2});
  EXPECT_EQ(peers.workers(), (std::vector<WorkerId>{{1}, {2}}));
}

TEST(Peers, FollowASessionToItsNewConnection) {
  Peers peers;
  (void)peers.meet({11}, 1, at("a"));
  EXPECT_EQ(peers.meet({11}, 2, at("b")), WorkerId{1});
  EXPECT_EQ(peers.address_of({1})->routing_id, "b");
  EXPECT_EQ(peers.worker_at("a"), std::nullopt);
  EXPECT_EQ(peers.worker_at("b"), WorkerId{1});
}

// What was under way on the connection that broke is read after the first words on the new one.
TEST(Peers, DoNotFollowAMessageOfAConnectionThatWasLeft) {
  Peers peers;
  (void)peers.meet({11}, 5, at("a"));
  (void)peers.meet({11}, 7, at("b"));
  EXPECT_EQ(peers.meet({11}, 6, at("a")), WorkerId{1});
  EXPECT_EQ(peers.address_of({1})->routing_id, "b");
}

TEST(Peers, LetNoOtherKeyTakeASession) {
  Peers peers;
  (void)peers.meet({11}, 1, at("a", "key"));
  EXPECT_EQ(peers.meet({11}, 2, at("b", "other")), std::nullopt);
  EXPECT_EQ(peers.address_of({1})->routing_id, "a");
}

TEST(Peers, LetNoConnectionHaveTwoSessions) {
  Peers peers;
  (void)peers.meet({11}, 1, at("a"));
  (void)peers.meet({13}, 1, at("c"));
  EXPECT_EQ(peers.meet({12}, 1, at("a")), std::nullopt);
  EXPECT_EQ(peers.meet({13}, 2, at("a")), std::nullopt);
  EXPECT_EQ(peers.worker_of({12}), std::nullopt);
  EXPECT_EQ(peers.address_of({2})->routing_id, "c");
}

TEST(Peers, NumberTheMessagesToEachWorker) {
  Peers peers;
  (void)peers.meet({11}, 1, at("a"));
  (void)peers.meet({12}, 1, at("b"));
  proto::Envelope message;
  peers.address({1}, message);
  EXPECT_EQ(message.session(), 11U);
  EXPECT_EQ(message.sequence(), 1U);
  peers.address({1}, message);
  EXPECT_EQ(message.sequence(), 2U);
  peers.address({2}, message);
  EXPECT_EQ(message.sequence(), 1U);
}

TEST(Peers, ForgetAWorkerAltogether) {
  Peers peers;
  (void)peers.meet({11}, 1, at("a"));
  peers.forget({1});
  EXPECT_EQ(peers.address_of({1}), nullptr);
  EXPECT_EQ(peers.worker_at("a"), std::nullopt);
  EXPECT_EQ(peers.session_of({1}), std::nullopt);
  EXPECT_EQ(peers.meet({11}, 1, at("a")), WorkerId{2});
}

TEST(Peers, ForgetStrangersOnceThereAreTooMany) {
  Peers peers({.peers_max = 3, .closed_out_max = 2});
  (void)peers.meet({11}, 1, at("a"));
  (void)peers.meet({12}, 1, at("b"));
  const auto is_first = [](WorkerId worker) { return worker == WorkerId{1}; };
  peers.limit(is_first);
  EXPECT_EQ(peers.workers().size(), 2U);
  (void)peers.meet({13}, 1, at("c"));
  peers.limit(is_first);
  EXPECT_EQ(peers.workers(), std::vector<WorkerId>{{1}});
}

TEST(Peers, RememberWhoWasClosedOutUpToALimit) {
  Peers peers({.peers_max = 3, .closed_out_max = 2});
  peers.close_out("a");
  peers.close_out("b");
  EXPECT_TRUE(peers.is_closed_out("a"));
  peers.close_out("c");
  EXPECT_FALSE(peers.is_closed_out("a"));
  EXPECT_TRUE(peers.is_closed_out("c"));
}

TEST(PeerAddress, IsWrittenForPeople) {
  EXPECT_EQ(to_text(fields_of({.routing_id = "\1", .key = "abc", .host = "10.0.0.7"})),
            "address=10.0.0.7 key=abc");
  EXPECT_EQ(to_text(fields_of({.routing_id = "\1", .key = "", .host = ""})),
            "address=unknown key=none");
}

}  // namespace
}  // namespace proofmass::coordinator
