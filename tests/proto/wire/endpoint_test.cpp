#include "proto/wire/endpoint.hpp"

#include <gtest/gtest.h>

#include "core/error.hpp"

namespace proofmass::wire {
namespace {

std::string refusal(const std::string& endpoint) {
  try {
    check_endpoint("bind", endpoint);
  } catch (const InvalidArgument& error) {
    return error.what();
  }
  return "accepted";
}

TEST(Endpoint, MayBeASocketFileOrAPortOnLoopback) {
  EXPECT_EQ(refusal("ipc:///tmp/x"), "accepted");
  EXPECT_EQ(refusal("tcp://127.0.0.1:5555"), "accepted");
  EXPECT_EQ(refusal("tcp://[::1]:5555"), "accepted");
  EXPECT_EQ(refusal("tcp://127.0.0.1:*"), "accepted");
}

TEST(Endpoint, OffLoopbackIsRefused) {
  for (const std::string address : {"tcp://0.0.0.0:5555", "tcp://*:5555", "tcp://192.168.1.2:5555",
                                    "tcp://127.0.0.1.example.org:5555", "tcp://localhost:5555"}) {
    EXPECT_EQ(refusal(address), "bind = " + address +
                                    " (must be on loopback, 127.0.0.1 or [::1]: connections are "
                                    "not encrypted)");
  }
}

TEST(Endpoint, OfAnotherTransportIsRefused) {
  EXPECT_EQ(refusal("udp://127.0.0.1:1"),
            "bind = udp://127.0.0.1:1 (must be ipc://PATH or tcp://127.0.0.1:PORT)");
}

TEST(Endpoint, NeedsAPort) {
  for (const std::string port : {"", "0", "65536", "12x", "-1"}) {
    EXPECT_EQ(refusal("tcp://127.0.0.1:" + port),
              "bind = tcp://127.0.0.1:" + port + " (the port must be in [1, 65535])");
  }
}

TEST(Endpoint, SocketFileHasAPathThatASocketCanHave) {
  EXPECT_EQ(refusal("ipc://"), "bind = ipc:// (the path must have 1 to 107 bytes)");
  const std::string path(108, 'a');
  EXPECT_EQ(refusal("ipc://" + path),
            "bind = ipc://" + path + " (the path must have 1 to 107 bytes)");
}

}  // namespace
}  // namespace proofmass::wire
