// Peers that break the rules, or may not be here at all: over real sockets.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include "tests/coordinator/net/service_fixture.hpp"

namespace proofmass::coordinator {
namespace {

using test::PlayingWorker;
using ::testing::_;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Pair;
using ::testing::StartsWith;

class ServiceStrangers : public test::ServiceTest {
 protected:
  /// The others are served as if nothing had happened.
  void expect_service() {
    PlayingWorker good(endpoint.address(), ++last_good_session_);
    EXPECT_EQ(good.borrow().num_runs(), 1U);
  }

 private:
  std::uint64_t last_good_session_ = 2000;
};

TEST_F(ServiceStrangers, AreClosedOutIfTheySendGarbage) {
  start({test::campaign_of("a", 10)});
  PlayingWorker bad(endpoint.address());
  (void)bad.borrow();
  bad.send_frames({"garbage"});
  const auto reject = bad.receive<proto::Reject>();
  EXPECT_EQ(reject.reason(), proto::REJECT_REASON_MALFORMED);
  EXPECT_EQ(reject.text(), "message = 7 bytes (must be an envelope of at most 65536 fields)");
  EXPECT_THAT(
      wait_for_event("peer_closed_out"),
      AllOf(
          HasSubstr(fmt::format(":{} key=none ", getpid())),
          HasSubstr("reason=\"message = 7 bytes (must be an envelope of at most 65536 fields)\"")));
  bad.say_hello();  // Not listened to any more.
  expect_service();
  in_service([&] { EXPECT_FALSE(service->worker_of(1001)); });
}

TEST_F(ServiceStrangers, AreToldWhatIsWrongAndClosedOut) {
  using Frames = std::vector<std::string>;
  start({test::campaign_of("a", 10)});
  const auto reject_of = [&](std::uint64_t session, const auto& frames_of) {
    PlayingWorker bad(endpoint.address(), session);
    bad.send_frames(frames_of(bad));
    const auto reject = bad.receive<proto::Reject>();
    expect_service();
    return std::pair(reject.reason(), reject.text());
  };
  const auto bye = [](PlayingWorker& worker) {
    return wire::encode(worker.next_envelope(test::make_bye(LossReason::drained)));
  };
  EXPECT_THAT(reject_of(1001,
                        [](PlayingWorker&) {
                          return Frames{"a", "b"};
                        }),
              Pair(proto::REJECT_REASON_MALFORMED, "message = 2 frames (must be one)"));
  const auto of_a_coordinator = [](PlayingWorker& bad) {
    return Frames{wire::encode(bad.next_envelope(proto::Stop()))};
  };
  EXPECT_THAT(reject_of(1002, of_a_coordinator),
              Pair(proto::REJECT_REASON_MALFORMED,
                   "message = one of a coordinator (must be one of a worker)"));
  const auto cut_short = [&](PlayingWorker& bad) {
    const std::string bytes = bye(bad);
    return Frames{bytes.substr(0, bytes.size() - 1)};
  };
  EXPECT_THAT(reject_of(1003, cut_short), Pair(proto::REJECT_REASON_MALFORMED, _));
  const auto of_another_version = [&](PlayingWorker& bad) {
    std::string bytes = bye(bad);
    bytes[1] = 99;  // The version is the first field of the envelope.
    return Frames{bytes};
  };
  EXPECT_THAT(
      reject_of(1004, of_another_version),
      Pair(proto::REJECT_REASON_INCOMPATIBLE, StartsWith("protocol_version = 99 (must be ")));
}

}  // namespace
}  // namespace proofmass::coordinator
