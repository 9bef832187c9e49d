#include "proto/wire/endpoint.hpp"

#include "core/error.hpp"
#include "proto/wire/names.hpp"
#include "tests/test.hpp"

namespace proofmass::wire {
namespace {

std::string refusal(const std::string& endpoint, EndpointUse use, Protection protection) {
  try {
    check_endpoint(use == EndpointUse::bind ? "bind" : "connect", endpoint, use, protection);
  } catch (const InvalidArgument& error) {
    return error.what();
  }
  return "accepted";
}

std::string refusal_to_bind(const std::string& endpoint) {
  return refusal(endpoint, EndpointUse::bind, Protection::none);
}

TEST(Endpoint, OnThisMachineNeedsNoKeys) {
  for (const std::string endpoint : {"ipc:///tmp/x", "tcp://127.0.0.1:5555", "tcp://[::1]:5555",
                                     "tcp://127.255.0.3:1", "tcp://127.0.0.1:65535"}) {
    for (const EndpointUse use : {EndpointUse::bind, EndpointUse::connect}) {
      for (const Protection protection : {Protection::none, Protection::keys, Protection::waived}) {
        EXPECT_EQ(refusal(endpoint, use, protection), "accepted") << endpoint;
      }
    }
    EXPECT_TRUE(is_local(endpoint)) << endpoint;
  }
}

TEST(Endpoint, ThatOthersCanReachNeedsKeysOrAWaiver) {
  for (const std::string host : {"0.0.0.0", "192.168.1.2", "128.0.0.1", "[::]", "[fe80::1]",
                                 "[::ffff:10.0.0.1]", "localhost", "127.0.0.1.example.org", "127.1",
                                 "0x7f000001", "2130706433", "eth0", "node-17.cluster"}) {
    const std::string endpoint = "tcp://" + host + ":5555";
    EXPECT_FALSE(is_local(endpoint)) << endpoint;
    for (const EndpointUse use : {EndpointUse::bind, EndpointUse::connect}) {
      const std::string option = use == EndpointUse::bind ? "bind" : "connect";
      EXPECT_EQ(refusal(endpoint, use, Protection::none),
                option + " = " + endpoint +
                    " (needs --keys, or --insecure-plain on a network that you trust)");
      EXPECT_EQ(refusal(endpoint, use, Protection::keys), "accepted") << endpoint;
      EXPECT_EQ(refusal(endpoint, use, Protection::waived), "accepted") << endpoint;
    }
  }
  EXPECT_EQ(refusal_to_bind("tcp://*:5555"),
            "bind = tcp://*:5555 (needs --keys, or --insecure-plain on a network that you trust)");
  EXPECT_FALSE(is_local("tcp://*:5555"));
}

TEST(Endpoint, ToConnectNamesOneHostAndPort) {
  const std::string host_rule = " (the host must be a name, an IPv4 address or [IPv6])";
  EXPECT_EQ(refusal("tcp://*:5555", EndpointUse::connect, Protection::keys),
            "connect = tcp://*:5555" + host_rule);
  EXPECT_EQ(refusal("tcp://127.0.0.1:*", EndpointUse::connect, Protection::none),
            "connect = tcp://127.0.0.1:* (the port must be in [1, 65535])");
  EXPECT_EQ(refusal("tcp://127.0.0.1:*", EndpointUse::bind, Protection::none), "accepted");
  EXPECT_EQ(refusal("tcp://*:*", EndpointUse::bind, Protection::keys), "accepted");
}

// libzmq reads `source;destination`, and names with a scope or a path that nobody means.
TEST(Endpoint, HasAHostThatIsOne) {
  for (const std::string host :
       {"", "127.0.0.1:0;10.0.0.1", "[::1", "::1", "[]", "[x]", "a b", "[::1]%lo", "user@host"}) {
    const std::string endpoint = "tcp://" + host + ":5555";
    EXPECT_EQ(refusal(endpoint, EndpointUse::connect, Protection::keys),
              "connect = " + endpoint + " (the host must be a name, an IPv4 address or [IPv6])");
  }
  EXPECT_EQ(refusal_to_bind("tcp://" + std::string(254, 'a') + ":1").substr(0, 10), "bind = tcp");
  EXPECT_NE(
      refusal("tcp://" + std::string(254, 'a') + ":1", EndpointUse::connect, Protection::keys),
      "accepted");
}

TEST(Endpoint, NeedsAPort) {
  for (const std::string port : {"", "0", "65536", "12x", "-1"}) {
    EXPECT_EQ(refusal_to_bind("tcp://127.0.0.1:" + port),
              "bind = tcp://127.0.0.1:" + port + " (the port must be in [1, 65535])");
  }
}

TEST(Endpoint, SocketFileHasAPathThatASocketCanHave) {
  EXPECT_EQ(refusal_to_bind("ipc://"), "bind = ipc:// (the path must have 1 to 107 bytes)");
  const std::string path(108, 'a');
  EXPECT_EQ(refusal_to_bind("ipc://" + path),
            "bind = ipc://" + path + " (the path must have 1 to 107 bytes)");
}

TEST(Endpoint, HasNoZeroByte) {
  EXPECT_EQ(refusal_to_bind(std::string("ipc:///tmp/x\0y", 14)),
            "bind =  (must not have a zero byte)");
}

TEST(Endpoint, IsOfIpv6WhereItCanBe) {
  EXPECT_FALSE(may_be_ipv6("ipc:///tmp/x", EndpointUse::bind));
  EXPECT_FALSE(may_be_ipv6("tcp://10.0.0.1:1", EndpointUse::connect));
  EXPECT_TRUE(may_be_ipv6("tcp://[::1]:1", EndpointUse::connect));
  EXPECT_TRUE(may_be_ipv6("tcp://*:1", EndpointUse::bind));
  EXPECT_TRUE(may_be_ipv6("tcp://node-1:1", EndpointUse::connect));
  EXPECT_FALSE(may_be_ipv6("tcp://eth0:1", EndpointUse::bind));
}

TEST(Name, IsOfLettersDigitsAndThreeSigns) {
  EXPECT_TRUE(is_name("host-1.example_A"));
  EXPECT_FALSE(is_name("two words"));
  for (const char* name : {"..", ".answers", "-rf", "--help", "_a", "/a"}) {
    EXPECT_FALSE(is_name(name)) << name;
  }
  EXPECT_FALSE(is_name("line\nbreak"));
  EXPECT_FALSE(is_name("é"));
}

TEST(Name, HasOneTo128Characters) {
  EXPECT_FALSE(is_name(""));
  EXPECT_TRUE(is_name(std::string(128, 'a')));
  EXPECT_FALSE(is_name(std::string(129, 'a')));
}

TEST(Name, IsMadeFromAnyText) {
  EXPECT_EQ(name_from("my host"), "my-host");
  EXPECT_EQ(name_from("-rf"), "xrf");
  EXPECT_EQ(name_from("éa"), "x-a");
  EXPECT_EQ(name_from(""), "unnamed");
  EXPECT_EQ(name_from(std::string(500, 'x')), std::string(128, 'x'));
}

}  // namespace
}  // namespace proofmass::wire
