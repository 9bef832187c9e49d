#include "coordinator/net/router_socket.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <zmq.hpp>

#include "coordinator/net/authentication/authenticator.hpp"
#include "coordinator/net/private_endpoint.hpp"
#include "proto/link/keys.hpp"
#include "proto/link/socket.hpp"
#include "proto/wire/endpoint.hpp"
#include "tests/proto/link/scratch_directory.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using Clock = std::chrono::steady_clock;

class RouterSocketTest : public testing::Test {
 protected:
  /// What arrives, while `act` goes on, until something has.
  std::string received(RouterSocket& router, const std::function<void()>& act) {
    std::string text;
    const auto deadline = Clock::now() + std::chrono::seconds(20);
    while (text.empty() && Clock::now() < deadline) {
      act();
      router.receive(10, Clock::now(), [&](const Incoming& message) {
        text = std::string(message.frames.front());
        sender = message.from.routing_id;
      });
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return text;
  }

  test::ScratchDirectory directory;
  std::string sender;
  zmq::context_t context;
  zmq::context_t peers_context;
};

TEST_F(RouterSocketTest, IsBoundToTheSameAddressAgainAndPeersComeBack) {
  for (const std::string& where :
       {std::string("tcp://127.0.0.1:*"), "ipc://" + (directory / "socket").string()}) {
    RouterSocket router(context, "bind", where, {});
    const std::string endpoint = router.endpoint();
    zmq::socket_t dealer = wire::make_dealer(peers_context, {});
    dealer.connect(endpoint);
    const auto say = [&](std::string_view text) {
      return [&dealer, text] { dealer.send(zmq::buffer(text), zmq::send_flags::dontwait); };
    };
    EXPECT_EQ(received(router, say("before")), "before");
    EXPECT_TRUE(router.send(sender, "to one who is there", Clock::now()));
    for (int i = 0; i < 20; ++i) {
      router.close();
      EXPECT_EQ(router.handle(), nullptr);
      EXPECT_FALSE(router.send(sender, "to nobody", Clock::now()));
      ASSERT_TRUE(router.open()) << where << i;
      EXPECT_EQ(router.endpoint(), endpoint);
    }
    EXPECT_FALSE(router.send(sender, "to one of before", Clock::now()));
    EXPECT_EQ(received(router, say("after")), "after");
  }
}

// A peer that connected before there was a router is served, and comes back to an address that was
// bound again.
TEST_F(RouterSocketTest, TakesOverASocketThatListensAlready) {
  const PrivateEndpoint private_endpoint;
  const int listener = private_endpoint.listen();
  zmq::socket_t dealer = wire::make_dealer(peers_context, {});
  wire::SocketEvents events(peers_context, dealer.handle(), ZMQ_EVENT_CONNECTED);
  dealer.connect(private_endpoint.address());
  const auto deadline = Clock::now() + std::chrono::seconds(20);
  while (!events.take() && Clock::now() < deadline) std::this_thread::yield();
  RouterSocket router(context, "bind", private_endpoint.address(), {}, listener);
  EXPECT_EQ(router.endpoint(), private_endpoint.address());
  const auto say = [&dealer] { dealer.send(zmq::str_buffer("text"), zmq::send_flags::dontwait); };
  EXPECT_EQ(received(router, say), "text");
  router.close();
  ASSERT_TRUE(router.open());
  EXPECT_EQ(received(router, say), "text");
}

TEST_F(RouterSocketTest, SaysThatItsAddressCannotBeHadNow) {
  RouterSocket router(context, "bind", "tcp://127.0.0.1:*", {});
  router.close();
  {
    const zmq::socket_t other = wire::make_router(context, "bind", router.endpoint(), {});
    EXPECT_FALSE(router.open());
    EXPECT_EQ(router.handle(), nullptr);
  }
  const auto deadline = Clock::now() + std::chrono::seconds(20);
  bool is_open = false;
  while (!is_open && Clock::now() < deadline) is_open = router.open();
  EXPECT_TRUE(is_open);
}

TEST_F(RouterSocketTest, TellsOfFailedHandshakesAlsoWhenItWasBoundAgain) {
  RouterSocket router(context, "bind", "tcp://127.0.0.1:*",
                      {.peers = wire::KeyRole::worker, .keys = wire::make_key_pair()});
  router.close();
  ASSERT_TRUE(router.open());
  zmq::socket_t plain = wire::make_dealer(peers_context, {});
  plain.connect(router.endpoint());
  const auto deadline = Clock::now() + std::chrono::seconds(20);
  bool is_told = false;
  while (!is_told && Clock::now() < deadline) {
    const auto event = router.take_event();
    is_told = event && (event->kind & failed_handshakes) != 0;
  }
  EXPECT_TRUE(is_told);
}

TEST(PrivateEndpoint, LiesInADirectoryThatOnlyThisUserCanEnter) {
  const PrivateEndpoint endpoint;
  EXPECT_NO_THROW(wire::check_endpoint("bind", endpoint.address(), wire::EndpointUse::bind,
                                       wire::Protection::none));
  const std::filesystem::path socket = endpoint.address().substr(6);
  const auto permissions = std::filesystem::status(socket.parent_path()).permissions();
  EXPECT_EQ(permissions, std::filesystem::perms::owner_all);
}

TEST(PrivateEndpoint, LeavesNothingBehind) {
  std::filesystem::path directory;
  {
    const PrivateEndpoint endpoint;
    directory = std::filesystem::path(endpoint.address().substr(6)).parent_path();
    EXPECT_TRUE(std::filesystem::exists(directory));
  }
  EXPECT_FALSE(std::filesystem::exists(directory));
}

TEST(PrivateEndpoint, IsAnotherEachTime) {
  EXPECT_NE(PrivateEndpoint().address(), PrivateEndpoint().address());
}

/// Directories in a place of their own.
class StaleEndpoint : public testing::Test {
 protected:
  /// What a killed process leaves, or something that resembles it.
  [[nodiscard]] std::filesystem::path make(const std::string& name, mode_t mode = S_IRWXU) const {
    const std::filesystem::path path = directory / name;
    std::filesystem::create_directory(path);
    std::ofstream(path / "lock").flush();
    std::ofstream(path / "workers").flush();
    chmod(path.c_str(), mode);
    return path;
  }
  [[nodiscard]] bool is_left_by_removal(const std::filesystem::path& path) const {
    remove_stale_endpoints(directory / "");
    return std::filesystem::exists(path / "workers");
  }

  test::ScratchDirectory directory;
};

TEST_F(StaleEndpoint, IsRemoved) {
  const std::filesystem::path path = make("proofmass-run-a1B2c3");
  EXPECT_FALSE(is_left_by_removal(path));
  EXPECT_FALSE(std::filesystem::exists(path));
}

TEST_F(StaleEndpoint, IsLeftWhileItsLockIsHeld) {
  const std::filesystem::path path = make("proofmass-run-a1B2c3");
  const int lock = open((path / "lock").c_str(), O_RDWR);
  ASSERT_EQ(flock(lock, LOCK_EX), 0);
  EXPECT_TRUE(is_left_by_removal(path));
  close(lock);
  EXPECT_FALSE(is_left_by_removal(path));
}

TEST_F(StaleEndpoint, IsNothingElse) {
  EXPECT_TRUE(is_left_by_removal(make("proofmass-run-a1B2c3d")));
  EXPECT_TRUE(is_left_by_removal(make("proofmass-new-a1B2c3")));
  EXPECT_TRUE(is_left_by_removal(make("other-run-a1B2c3")));
  EXPECT_TRUE(is_left_by_removal(make("proofmass-run-open00", 0755)));
  const std::filesystem::path without_lock = make("proofmass-run-nolock");
  std::filesystem::remove(without_lock / "lock");
  EXPECT_TRUE(is_left_by_removal(without_lock));
  const std::filesystem::path target = make("target");
  std::filesystem::create_directory_symlink(target, directory / "proofmass-run-linked");
  EXPECT_TRUE(is_left_by_removal(target));
  const std::filesystem::path link = make("proofmass-run-lock_l");
  std::filesystem::remove(link / "lock");
  std::filesystem::create_symlink(target / "lock", link / "lock");
  EXPECT_TRUE(is_left_by_removal(link));
}

TEST_F(StaleEndpoint, KeepsWhatSomebodyElsePutThere) {
  const std::filesystem::path path = make("proofmass-run-a1B2c3");
  std::ofstream(path / "notes") << "precious";
  remove_stale_endpoints(directory / "");
  EXPECT_TRUE(std::filesystem::exists(path / "notes"));
}

}  // namespace
}  // namespace proofmass::coordinator
