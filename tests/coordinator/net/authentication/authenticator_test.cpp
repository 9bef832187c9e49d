#include "coordinator/net/authentication/authenticator.hpp"

#include <zmq.hpp>

#include "core/error.hpp"
#include "proto/link/keys.hpp"
#include "proto/link/socket.hpp"
#include "proto/link/whole_file.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using wire::ClientSecurity;
using wire::KeyPair;
using wire::KeyRole;
using Clock = std::chrono::steady_clock;

// A worker's or client's end, in a context of its own as if in another process.
struct Peer {
  Peer(const std::string& endpoint, const ClientSecurity& security)
      : dealer(wire::make_dealer(context, security)),
        monitor(context, dealer, endpoint, security, Clock::time_point{}) {}

  zmq::context_t context;
  zmq::socket_t dealer;
  wire::ConnectionMonitor monitor;
};

// Both doors of a coordinator, with a clock that the test turns.
class AuthenticatorTest : public ::testing::Test {
 protected:
  AuthenticatorTest() {
    write_lists(worker_.public_key.text() + " worker\n", client_.public_key.text() + " client\n");
    authenticator_ = std::make_unique<Authenticator>(
        context_, directory_.path(), [this](Event event) { events_.push_back(std::move(event)); });
    for (const KeyRole domain : {KeyRole::worker, KeyRole::client}) {
      routers_.emplace(domain, wire::make_router(context_, "bind", "tcp://127.0.0.1:*",
                                                 {.peers = domain, .keys = coordinator_}));
      events_of_routers_.emplace(
          domain, std::make_unique<wire::SocketEvents>(context_, routers_.at(domain).handle(),
                                                       failed_handshakes));
    }
  }

  void write_lists(const std::string& workers, const std::string& clients) {
    wire::write_whole_file("list", directory_ / "authorized_workers", workers, 0644,
                           wire::IfThere::replace);
    wire::write_whole_file("list", directory_ / "authorized_clients", clients, 0644,
                           wire::IfThere::replace);
  }

  [[nodiscard]] std::string endpoint(KeyRole domain) const {
    return routers_.at(domain).get(zmq::sockopt::last_endpoint);
  }

  [[nodiscard]] ClientSecurity identity(KeyRole role, const KeyPair& keys) const {
    return {.identity = wire::CurveIdentity{
                .role = role, .keys = keys, .coordinator = coordinator_.public_key}};
  }

  // Lets both ends do what they have to until `is_enough`, or 20 s have passed.
  bool until(Peer& peer, const std::function<bool()>& is_enough) {
    const auto deadline = Clock::now() + std::chrono::seconds(20);
    while (!is_enough()) {
      if (Clock::now() > deadline) return false;
      std::vector<zmq::pollitem_t> items{{authenticator_->handle(), 0, ZMQ_POLLIN, 0},
                                         {peer.monitor.handle(), 0, ZMQ_POLLIN, 0},
                                         {routers_.at(KeyRole::worker).handle(), 0, ZMQ_POLLIN, 0},
                                         {routers_.at(KeyRole::client).handle(), 0, ZMQ_POLLIN, 0}};
      zmq::poll(items, std::chrono::milliseconds(20));
      for (const auto& [domain, events] : events_of_routers_) {
        while (const auto event = events->take()) authenticator_->on_event(domain, *event, now_);
      }
      authenticator_->serve(now_);
      peer.monitor.update(now_);
    }
    return true;
  }

  // What the peer is told about being refused, once the coordinator has logged it as well.
  std::string refusal(Peer& peer) {
    std::optional<std::string> text;
    until(peer, [&] {
      if (!text) text = peer.monitor.take_refusal();
      return peer.monitor.is_connected() || (text && !events_.empty());
    });
    return peer.monitor.is_connected() ? "connected" : text.value_or("nothing");
  }

  // Takes the next message at a door and says whose it is; empty if none comes.
  std::string user_of_next(Peer& peer, KeyRole domain) {
    zmq::message_t id;
    zmq::message_t frame;
    zmq::socket_t& router = routers_.at(domain);
    until(peer, [&] { return router.recv(id, zmq::recv_flags::dontwait).has_value(); });
    if (!router.recv(frame, zmq::recv_flags::dontwait)) return "";
    const char* const user = zmq_msg_gets(frame.handle(), "User-Id");
    return user == nullptr ? "nobody" : user;
  }

  // What is logged of one refusal but the address, which is this host's.
  [[nodiscard]] std::string logged() const {
    return events_.empty() ? "nothing" : to_text(events_.front().fields);
  }

  test::ScratchDirectory directory_;
  KeyPair coordinator_ = wire::make_key_pair();
  KeyPair worker_ = wire::make_key_pair();
  KeyPair client_ = wire::make_key_pair();
  KeyPair stranger_ = wire::make_key_pair();
  std::vector<Event> events_;
  Clock::time_point now_{};
  zmq::context_t context_;
  std::unique_ptr<Authenticator> authenticator_;
  std::map<KeyRole, zmq::socket_t> routers_;
  std::map<KeyRole, std::unique_ptr<wire::SocketEvents>> events_of_routers_;
};

std::string key_refusal(const KeyPair& keys, const std::string& endpoint, const std::string& role) {
  return "key = " + keys.public_key.text() + " (refused by the coordinator at " + endpoint +
         ": must be in its authorized_" + role + "s, and this its address for " + role + "s)";
}

TEST_F(AuthenticatorTest, AdmitsListedKeysAndNamesThemWithEachMessage) {
  for (const auto& [domain, role, keys] : {std::tuple{KeyRole::worker, KeyRole::worker, worker_},
                                           {KeyRole::client, KeyRole::client, client_}}) {
    Peer peer(endpoint(domain), identity(role, keys));
    ASSERT_TRUE(until(peer, [&] { return peer.monitor.is_connected(); }));
    peer.dealer.send(zmq::str_buffer("hello"), zmq::send_flags::dontwait);
    EXPECT_EQ(user_of_next(peer, domain), keys.public_key.text());
  }
  EXPECT_EQ(authenticator_->client(client_.public_key.text(), now_).value().name,
            to_text(KeyRole::client));
  EXPECT_TRUE(events_.empty()) << logged();
}

TEST_F(AuthenticatorTest, AdmitsAKeyThatIsListedLater) {
  Peer peer(endpoint(KeyRole::worker), identity(KeyRole::worker, stranger_));
  ASSERT_NE(refusal(peer), "connected");
  write_lists(stranger_.public_key.text() + " late\n", "");
  now_ += std::chrono::seconds(1);
  EXPECT_TRUE(until(peer, [&] { return peer.monitor.is_connected(); }));
}

TEST_F(AuthenticatorTest, RevokedKeyMaySpeakNoMoreThoughItsConnectionStands) {
  Peer peer(endpoint(KeyRole::worker), identity(KeyRole::worker, worker_));
  ASSERT_TRUE(until(peer, [&] { return peer.monitor.is_connected(); }));
  const std::string key = worker_.public_key.text();
  EXPECT_TRUE(authenticator_->is_allowed(KeyRole::worker, key, now_));
  EXPECT_FALSE(authenticator_->is_allowed(KeyRole::client, key, now_));

  write_lists("#" + key + " worker\n", "");
  now_ += std::chrono::seconds(1);
  EXPECT_TRUE(authenticator_->is_allowed(KeyRole::worker, key, now_)) << "one look is not enough";
  now_ += std::chrono::seconds(1);

  EXPECT_FALSE(authenticator_->is_allowed(KeyRole::worker, key, now_));
  peer.dealer.send(zmq::str_buffer("still here"), zmq::send_flags::dontwait);
  EXPECT_EQ(user_of_next(peer, KeyRole::worker), key);

  Peer again(endpoint(KeyRole::worker), identity(KeyRole::worker, worker_));
  EXPECT_EQ(refusal(again), key_refusal(worker_, endpoint(KeyRole::worker), "worker"));
}

// The first message of a client may be the only one that a coordinator gets in an hour.
TEST_F(AuthenticatorTest, RevokesKeysWhileNobodyConnectsOrSpeaks) {
  const std::string key = client_.public_key.text();
  write_lists("# none\n", "#" + key + " client\n");
  for (int second = 1; second <= 2; ++second) {
    now_ += std::chrono::seconds(1);
    authenticator_->serve(now_);
  }
  EXPECT_FALSE(authenticator_->client(key, now_));
  EXPECT_FALSE(authenticator_->is_allowed(KeyRole::worker, worker_.public_key.text(), now_));
}

TEST_F(AuthenticatorTest, MessageWithoutAUserIsNotAllowed) {
  EXPECT_FALSE(authenticator_->is_allowed(KeyRole::worker, "", now_));
}

TEST_F(AuthenticatorTest, ListThatCannotBeReadIsLoggedAndTheOldOneStands) {
  write_lists("nonsense\n", "");
  EXPECT_TRUE(authenticator_->is_allowed(KeyRole::worker, worker_.public_key.text(), now_));
  ASSERT_EQ(events_.size(), 1u);
  EXPECT_EQ(events_[0].kind, "allow_list_unreadable");
  EXPECT_EQ(events_[0].severity, Severity::error);
  EXPECT_EQ(to_text(events_[0].fields),
            (directory_ / "authorized_workers").string() +
                " line = 1 (must begin with a public key of 40 characters); the list before it "
                "stands");
}

TEST_F(AuthenticatorTest, RefusesThatWhichIsNoQuestion) {
  zmq::socket_t asker(context_, zmq::socket_type::req);
  asker.connect("inproc://zeromq.zap.01");
  const auto ask = [&](const std::vector<std::string>& frames) {
    for (std::size_t i = 0; i < frames.size(); ++i) {
      asker.send(zmq::buffer(frames[i]),
                 i + 1 < frames.size() ? zmq::send_flags::sndmore : zmq::send_flags::none);
    }
    // A reply comes through the context's own threads.
    zmq::pollitem_t item{authenticator_->handle(), 0, ZMQ_POLLIN, 0};
    zmq::poll(&item, 1, std::chrono::seconds(20));
    authenticator_->serve(now_);
    std::vector<std::string> reply;
    zmq::message_t frame;
    do {
      if (!asker.recv(frame)) break;
      reply.push_back(frame.to_string());
    } while (frame.more());
    return reply;
  };
  using Frames = std::vector<std::string>;
  const Frames malformed{"1.0", "", "500", "malformed", "", ""};
  EXPECT_EQ(ask({"x"}), malformed);
  EXPECT_EQ(ask({"2.0", "7", "workers", "a", "", "CURVE", std::string(32, 'k')}),
            (Frames{"1.0", "7", "500", "malformed", "", ""}));
  const Frames refused{"1.0", "7", "400", "key not authorized", "", ""};
  EXPECT_EQ(ask({"1.0", "7", "workers", "a", "", "CURVE", std::string(31, 'k')}), refused);
  EXPECT_EQ(ask({"1.0", "7", "workers", "a", "", "CURVE"}), refused);
  EXPECT_EQ(ask({"1.0", "7", "workers", "a", "", "NULL"}), refused);
  EXPECT_EQ(ask({"1.0", "7", "workers", "a", "", "PLAIN", "user", "password"}), refused);
  EXPECT_EQ(ask({"1.0", "7", "kitchen", "a", "", "CURVE", std::string(32, 'k')}), refused);
  EXPECT_EQ(ask(Frames(100, "1.0")), (Frames{"1.0", "1.0", "400", "key not authorized", "", ""}));
}

TEST(Authenticator, IsOneInAContext) {
  const test::ScratchDirectory directory;
  test::write_text(directory / "authorized_workers", "", 0644);
  test::write_text(directory / "authorized_clients", "", 0644);
  zmq::context_t context;
  const auto make = [&] { return Authenticator(context, directory.path(), [](Event) {}); };
  const Authenticator first = make();
  EXPECT_EQ(test::refusal_of([&] { const Authenticator second = make(); }),
            "authenticator = inproc://zeromq.zap.01 (Address already in use)");
}

}  // namespace
}  // namespace proofmass::coordinator
