#include "coordinator/page/http_server.hpp"

#include <fcntl.h>

#include "core/error.hpp"
#include "tests/coordinator/page/raw_client.hpp"
#include "tests/test.hpp"

namespace proofmass::coordinator {
namespace {

using test::RawClient;

/// A server that repeats the target of each request.
class HttpServerTest : public ::testing::Test {
 protected:
  void start() {
    server = std::make_unique<HttpServer>(
        config, [this](const HttpRequest& request, HttpServer::Patience patience) {
          return handler(request, patience);
        });
  }
  std::string answer_to(const std::string& bytes) {
    RawClient client(server->port());
    client.send(bytes);
    return client.rest();
  }

  HttpConfig config;
  HttpServer::Handler handler = [](const HttpRequest& request, HttpServer::Patience) {
    return HttpAnswer{.body = request.target};
  };
  std::unique_ptr<HttpServer> server;
};

TEST_F(HttpServerTest, AnswersRequestsOnOneConnection) {
  config.headers = {{"X-Of-All", "yes"}};
  start();
  RawClient client(server->port());
  EXPECT_THAT(client.ask("/a"), StartsWith("HTTP/1.1 200 OK\r\n"));
  const std::string answer = client.ask("/b?c");
  EXPECT_THAT(answer, HasSubstr("X-Of-All: yes\r\n"));
  EXPECT_THAT(answer, HasSubstr("\r\n\r\n/b?c"));
  EXPECT_EQ(server->counts().num_requests, 2U);
}

TEST_F(HttpServerTest, AnswersRequestsThatComeTogether) {
  start();
  EXPECT_THAT(answer_to("GET /a HTTP/1.1\r\nHost: x\r\n\r\n"
                        "GET /b HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n"),
              testing::AllOf(HasSubstr("\r\n\r\n/aHTTP/1.1 200 OK"), HasSubstr("\r\n\r\n/b")));
}

TEST_F(HttpServerTest, HandsHeadersOn) {
  handler = [](const HttpRequest& request, HttpServer::Patience) {
    return HttpAnswer{.body = request.host + "|" + request.authorization + "|" + request.cookie};
  };
  start();
  EXPECT_THAT(answer_to("GET / HTTP/1.1\r\nHost: a\r\nAuthorization: b\r\nCookie: c\r\n"
                        "Connection: close\r\n\r\n"),
              HasSubstr("\r\n\r\na|b|c"));
  // Which of two names is meant is not clear: it is none.
  EXPECT_THAT(answer_to("GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\nConnection: close\r\n\r\n"),
              HasSubstr("\r\n\r\n||"));
}

TEST_F(HttpServerTest, AnswersHeadWithoutContent) {
  start();
  const std::string answer =
      answer_to("HEAD /abc HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n");
  EXPECT_THAT(answer, HasSubstr("Content-Length: 4\r\n"));
  EXPECT_THAT(answer, testing::EndsWith("\r\n\r\n"));
}

TEST_F(HttpServerTest, KnowsNoOtherMethod) {
  start();
  for (const std::string method : {"POST", "PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT"}) {
    const std::string answer = answer_to(method + " /a HTTP/1.1\r\nHost: x\r\n\r\n");
    EXPECT_THAT(answer, StartsWith("HTTP/1.1 405 Method Not Allowed\r\n")) << method;
    EXPECT_THAT(answer, HasSubstr("Allow: GET, HEAD\r\n")) << method;
  }
}

TEST_F(HttpServerTest, RefusesContent) {
  start();
  EXPECT_THAT(answer_to("GET / HTTP/1.1\r\nHost: x\r\nContent-Length: 1\r\n\r\na"),
              StartsWith("HTTP/1.1 413"));
  EXPECT_THAT(answer_to("GET / HTTP/1.1\r\nHost: x\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n"),
              StartsWith("HTTP/1.1 413"));
  EXPECT_THAT(answer_to("POST / HTTP/1.1\r\nHost: x\r\nContent-Length: 99999999999\r\n\r\n"),
              StartsWith("HTTP/1.1 413"));
}

TEST_F(HttpServerTest, RefusesHeadersThatAreTooLarge) {
  start();
  const std::string beginning = "GET / HTTP/1.1\r\nHost: x\r\nCookie: ";
  EXPECT_THAT(answer_to(beginning + std::string(9000, 'a') + "\r\n\r\n"),
              StartsWith("HTTP/1.1 431"));
  EXPECT_THAT(answer_to("GET /" + std::string(9000, 'a') + " HTTP/1.1\r\n\r\n"),
              StartsWith("HTTP/1.1 431"));
  EXPECT_THAT(answer_to(beginning + std::string(1'000'000, 'a')), StartsWith("HTTP/1.1 431"));
  EXPECT_THAT(answer_to(beginning + std::string(7000, 'a') + "\r\nConnection: close\r\n\r\n"),
              StartsWith("HTTP/1.1 200"));
}

TEST_F(HttpServerTest, RefusesWhatIsNoRequest) {
  start();
  EXPECT_THAT(answer_to("hello\r\n\r\n"), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(answer_to(std::string("\0\1\2\3\r\n\r\n", 8)), StartsWith("HTTP/1.1 400"));
  EXPECT_THAT(answer_to("GET / HTTP/9.9\r\n\r\n"), StartsWith("HTTP/1.1 400"));
}

// The first client has sent a byte and stops; the second must not wait for it.
TEST_F(HttpServerTest, LetsNoClientWaitForAnother) {
  start();
  const RawClient slow(server->port());
  slow.send("G");
  RawClient other(server->port());
  EXPECT_THAT(other.ask("/a"), StartsWith("HTTP/1.1 200"));
}

TEST_F(HttpServerTest, ClosesConnectionsThatDoNotFinishARequest) {
  config.request_duration_max = 50ms;
  start();
  RawClient silent(server->port());
  RawClient slow(server->port());
  slow.send("GET / HT");
  EXPECT_EQ(silent.rest(), "");
  EXPECT_EQ(slow.rest(), "");
}

// The deadline is that of the whole request: a byte now and then does not move it.
TEST_F(HttpServerTest, GivesNoTimeForASingleByte) {
  config.request_duration_max = 200ms;
  start();
  RawClient client(server->port());
  const auto begin = std::chrono::steady_clock::now();
  std::atomic<bool> is_over = false;
  std::thread dripping([&] {
    client.send("GET /");
    while (!is_over) {
      client.send("a");
      std::this_thread::yield();
      // At most the size that a header may have would come before the deadline.
      if (std::chrono::steady_clock::now() - begin > 10s) break;
      ::poll(nullptr, 0, 20);
    }
  });
  EXPECT_EQ(client.rest(), "");
  is_over = true;
  dripping.join();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 10s);
}

TEST_F(HttpServerTest, ClosesIdleConnections) {
  config.idle_max = 50ms;
  start();
  RawClient client(server->port());
  (void)client.ask("/a");
  EXPECT_EQ(client.rest(), "");
}

TEST_F(HttpServerTest, ClosesConnectionsThatDoNotTakeTheirAnswer) {
  config.answer_duration_max = 50ms;
  handler = [](const HttpRequest&, HttpServer::Patience) {
    return HttpAnswer{.body = std::string(std::size_t{64} << 20, 'x')};  // More than any buffer.
  };
  start();
  const RawClient client(server->port());
  client.send("GET / HTTP/1.1\r\nHost: x\r\n\r\n");
  while (server->counts().num_requests < 1) std::this_thread::yield();
  while (server->counts().num_connections > 0) std::this_thread::yield();
}

/// A client that has asked and does not take its answer.
class Stuck : public RawClient {
 public:
  explicit Stuck(std::uint16_t port, const std::string& target = "/large",
                 const std::string& address = "127.0.0.1")
      : RawClient(port, address) {
    send("GET " + target + " HTTP/1.1\r\nHost: localhost\r\n\r\n");
  }
};

/// Two connections at a time; the answer to /large is larger than any buffer, and that to a target
/// with `token` is given to somebody who has shown it.
class CrowdedHttpServer : public HttpServerTest {
 protected:
  CrowdedHttpServer() {
    config.num_connections_max = 2;
    handler = [](const HttpRequest& request, HttpServer::Patience) {
      const bool is_large = request.target.starts_with("/large");
      return HttpAnswer{.body = is_large ? std::string(std::size_t{16} << 20, 'x') : "small",
                        .has_shown_token = request.target.ends_with("token")};
    };
    start();
  }
  void wait_for_requests(std::uint64_t count) const {
    while (server->counts().num_requests < count) std::this_thread::yield();
  }
  void wait_for_connections(std::uint64_t count) const {
    while (server->counts().num_connections != count) std::this_thread::yield();
  }
  std::string answer_to_next() { return RawClient(server->port()).ask("/a"); }
};

TEST_F(CrowdedHttpServer, ClosesTheOldestThatAsksNothing) {
  const Stuck asking(server->port());
  wait_for_requests(1);
  RawClient silent(server->port());
  EXPECT_THAT(answer_to_next(), HasSubstr("small"));
  EXPECT_EQ(silent.rest(), "");
  wait_for_connections(1);
  RawClient half(server->port());
  half.send("GET /half HTTP/1.1\r\nHost");
  RawClient idle(server->port());
  (void)idle.ask("/a");  // It took the place of `half`.
  EXPECT_EQ(half.rest(), "");
  EXPECT_THAT(answer_to_next(), HasSubstr("small"));
  EXPECT_EQ(idle.rest(), "");
  EXPECT_EQ(server->counts().num_refused, 3U);
  wait_for_connections(1);  // That of `asking`.
}

TEST_F(CrowdedHttpServer, ClosesThatOfTheAddressWithMost) {
  server.reset();
  config.num_connections_max = 3;
  start();
  const Stuck other(server->port(), "/large", "127.0.0.9");
  wait_for_requests(1);
  Stuck first(server->port());
  wait_for_requests(2);
  const Stuck second(server->port());
  wait_for_requests(3);
  RawClient next(server->port(), "127.0.0.9");  // Nobody is silent: `first` goes.
  EXPECT_THAT(next.ask("/a"), HasSubstr("small"));
  RawClient after(server->port(), "127.0.0.9");  // `next` is silent now.
  EXPECT_EQ(next.rest(), "");
}

TEST_F(CrowdedHttpServer, RefusesWhatIsTooManyIfAllAreAnsweringAToken) {
  const Stuck first(server->port(), "/large?token");
  const Stuck second(server->port(), "/large?token");
  wait_for_requests(2);
  EXPECT_THAT(RawClient(server->port()).rest(), StartsWith("HTTP/1.1 503 Service Unavailable\r\n"));
  EXPECT_EQ(server->counts().num_refused, 1U);
}

TEST_F(HttpServerTest, AsksAgainForAnAnswerThatIsNotThereYet) {
  int num_asked = 0;
  handler = [&](const HttpRequest&, HttpServer::Patience) -> std::optional<HttpAnswer> {
    if (++num_asked < 3) return std::nullopt;
    return HttpAnswer{.body = "there"};
  };
  start();
  EXPECT_THAT(RawClient(server->port()).ask("/a"), HasSubstr("\r\n\r\nthere"));
  EXPECT_EQ(num_asked, 3);
}

TEST_F(HttpServerTest, DoesNotWaitForAnAnswerForEver) {
  config.wait_max = 50ms;
  bool is_last = false;
  handler = [&](const HttpRequest&, HttpServer::Patience patience) -> std::optional<HttpAnswer> {
    is_last = patience == HttpServer::Patience::over;
    return std::nullopt;
  };
  start();
  EXPECT_THAT(RawClient(server->port()).ask("/a"), StartsWith("HTTP/1.1 503"));
  EXPECT_TRUE(is_last);
}

TEST_F(HttpServerTest, SurvivesAnAnswerThatCannotBeMade) {
  handler = [](const HttpRequest& request, HttpServer::Patience) -> std::optional<HttpAnswer> {
    if (request.target == "/bad") throw std::runtime_error("secret reason");
    return HttpAnswer{};
  };
  start();
  RawClient client(server->port());
  const std::string answer = client.ask("/bad");
  EXPECT_THAT(answer, StartsWith("HTTP/1.1 500"));
  EXPECT_THAT(answer, Not(HasSubstr("secret")));
  EXPECT_THAT(client.ask("/good"), StartsWith("HTTP/1.1 200"));
}

TEST_F(HttpServerTest, EndsWithConnectionsOpen) {
  start();
  RawClient client(server->port());
  (void)client.ask("/a");
  server.reset();
  EXPECT_EQ(client.rest(), "");
}

// What a program that this process starts would keep open.
TEST_F(HttpServerTest, LeavesNothingToProgramsThatAreStarted) {
  std::set<int> before;
  const auto descriptors = [] {
    std::set<int> numbers;
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
      numbers.insert(std::stoi(entry.path().filename().string()));
    }
    return numbers;
  };
  before = descriptors();
  start();
  RawClient client(server->port());  // Its own socket may be inherited: one of the new ones.
  (void)client.ask("/a");
  int num_inherited = 0;
  for (const int descriptor : descriptors()) {
    const int flags = ::fcntl(descriptor, F_GETFD);
    if (!before.contains(descriptor) && flags >= 0 && (flags & FD_CLOEXEC) == 0) ++num_inherited;
  }
  EXPECT_EQ(num_inherited, 1);
}

TEST_F(HttpServerTest, NamesAnAddressThatCannotBeUsed) {
  start();
  const HttpConfig taken{.port = server->port()};
  EXPECT_EQ(test::message_of<Error>([&] { HttpServer second(taken, handler); }),
            "page = 127.0.0.1:" + std::to_string(server->port()) + " (Address already in use)");
  EXPECT_THAT(test::message_of<Error>([&] { HttpServer second({.host = "192.0.2.1"}, handler); }),
              HasSubstr("page = 192.0.2.1:0 (Cannot assign requested address)"));
}

}  // namespace
}  // namespace proofmass::coordinator
