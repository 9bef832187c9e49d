#include "coordinator/page/http_server.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <pthread.h>
#include <signal.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <exception>
#include <map>
#include <ranges>
#include <string>
#include <thread>
#include <vector>

#include "core/error.hpp"

namespace proofmass::coordinator {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = boost::beast::http;
using asio::ip::tcp;
using ErrorCode = boost::system::error_code;

constexpr std::chrono::milliseconds ask_again_after(20);
constexpr std::chrono::milliseconds accept_again_after(100);
constexpr std::chrono::milliseconds farewell_max(1000);
constexpr std::size_t farewell_size_max = 65'536;
constexpr int backlog = 128;

class Session;

/// What the connections of a server share.
struct Shared {
  HttpConfig config;
  HttpServer::Handler handler;
  std::vector<Session*> sessions;  // In the order of accepting; only the server's thread uses it.
  std::atomic<std::uint64_t> num_connections = 0;
  std::atomic<std::uint64_t> num_requests = 0;
  std::atomic<std::uint64_t> num_refused = 0;
};

HttpAnswer content_refusal() { return plain_answer(413, "a request must have no content"); }

/// A client of IPv6 may have many addresses: a network of 64 bits counts as one client.
std::string client_of(const tcp::socket& socket) {
  ErrorCode error;
  const asio::ip::address address = socket.remote_endpoint(error).address();
  if (error || !address.is_v6() || address.to_v6().is_v4_mapped()) return address.to_string();
  auto bytes = address.to_v6().to_bytes();
  std::fill(bytes.begin() + 8, bytes.end(), std::uint8_t{0});
  return asio::ip::address_v6(bytes).to_string();
}

/// A connection, from its first byte to its end. Its pending operation owns it.
class Session : public std::enable_shared_from_this<Session> {
 public:
  /// What can be lost when the connection is closed for another one; the first goes first.
  enum class Worth : std::uint8_t {
    silent,          ///< No request is being answered.
    answering,       ///< A request is; it showed no token.
    trusted_silent,  ///< Like `silent`, but an earlier request showed the token.
    trusted,         ///< Is never closed for another one.
  };

  Session(tcp::socket socket, Shared& shared)
      : shared_(shared),
        client_(client_of(socket)),
        stream_(std::move(socket)),
        timer_(stream_.get_executor()) {
    shared_.sessions.push_back(this);
    ++shared_.num_connections;
  }
  ~Session() { leave(); }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  [[nodiscard]] const std::string& client() const { return client_; }
  [[nodiscard]] Worth worth() const {
    if (is_answering_) return is_trusted_ ? Worth::trusted : Worth::answering;
    return is_trusted_ ? Worth::trusted_silent : Worth::silent;
  }

  /// Closes the connection at once.
  void close() {
    leave();
    stream_.close();
    timer_.cancel();
  }

  /// Waits for the first byte of a request, then for the whole request.
  void begin(std::chrono::milliseconds first_byte_max) {
    if (buffer_.size() > 0) return read();
    stream_.expires_after(first_byte_max);
    stream_.async_read_some(buffer_.prepare(1024),
                            [self = shared_from_this()](ErrorCode error, std::size_t size) {
                              if (error) return;
                              self->buffer_.commit(size);
                              self->read();
                            });
  }

 private:
  using Parser = http::request_parser<http::empty_body>;

  void leave() {
    if (std::erase(shared_.sessions, this) > 0) --shared_.num_connections;
  }

  void read() {
    parser_.emplace();
    parser_->header_limit(static_cast<std::uint32_t>(shared_.config.header_size_max));
    stream_.expires_after(shared_.config.request_duration_max);
    http::async_read_header(
        stream_, buffer_, *parser_,
        [self = shared_from_this()](ErrorCode error, std::size_t) { self->take(error); });
  }

  void take(ErrorCode error) {
    if (error == http::error::end_of_stream || error == beast::error::timeout) return;
    is_last_ = true;  // Unless all is well.
    if (error == http::error::header_limit || error == http::error::buffer_overflow) {
      return answer(plain_answer(431, "the header is too large"));
    }
    if (error == http::error::body_limit) return answer(content_refusal());
    if (error && error.category() != http::make_error_code(http::error::bad_method).category()) {
      return;  // The connection broke.
    }
    if (error) return answer(plain_answer(400, "this is no request of HTTP/1.1"));
    ++shared_.num_requests;
    const auto& message = parser_->get();
    is_head_ = message.method() == http::verb::head;
    if (!is_head_ && message.method() != http::verb::get) {
      HttpAnswer refusal = plain_answer(405, "only GET and HEAD are answered");
      refusal.headers.emplace_back("Allow", "GET, HEAD");
      return answer(std::move(refusal));
    }
    if (!parser_->is_done()) return answer(content_refusal());
    is_last_ = !message.keep_alive();
    note_request();
    is_answering_ = true;
    ask();
  }

  void note_request() {
    const auto& message = parser_->get();
    const auto text = [&](http::field field) { return std::string(message[field]); };
    request_ = {.target = std::string(message.target()),
                .host = text(http::field::host),
                .authorization = text(http::field::authorization),
                .cookie = text(http::field::cookie)};
    // A proxy may take another one of two such headers for the valid one.
    if (message.count(http::field::host) > 1) request_.host.clear();
    asked_at_ = std::chrono::steady_clock::now();
  }

  void ask() {
    using Patience = HttpServer::Patience;
    const auto waited = std::chrono::steady_clock::now() - asked_at_;
    const Patience patience = waited < shared_.config.wait_max ? Patience::left : Patience::over;
    std::optional<HttpAnswer> given;
    try {
      given = shared_.handler(request_, patience);
    } catch (const std::exception&) {
      given = plain_answer(500, "the page could not be made");
    }
    if (given) is_trusted_ = is_trusted_ || given->has_shown_token;
    if (given) return answer(std::move(*given));
    if (patience == Patience::over) return answer(plain_answer(503, "no answer in time"));
    stream_.expires_never();
    timer_.expires_after(ask_again_after);
    timer_.async_wait([self = shared_from_this()](ErrorCode error) {
      if (!error) self->ask();
    });
  }

  void answer(HttpAnswer given) {
    response_ = {};
    response_.version(11);
    response_.result(given.status);
    response_.set(http::field::content_type, given.content_type);
    for (const auto& [name, value] : shared_.config.headers) response_.set(name, value);
    for (const auto& [name, value] : given.headers) response_.set(name, value);
    response_.keep_alive(!is_last_);
    response_.content_length(given.body.size());
    if (!is_head_) response_.body() = std::move(given.body);
    stream_.expires_after(shared_.config.answer_duration_max);
    serializer_.emplace(response_);
    const auto then = [self = shared_from_this()](ErrorCode error, std::size_t) {
      if (!error) self->go_on();
    };
    if (is_head_) return http::async_write_header(stream_, *serializer_, then);
    http::async_write(stream_, *serializer_, then);
  }

  void go_on() {
    is_answering_ = false;
    if (!is_last_) return begin(shared_.config.idle_max);
    // A connection that is closed with bytes unread is reset, and the client may not see the
    // answer.
    ErrorCode ignored;
    stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
    stream_.expires_after(farewell_max);
    read_away(0);
  }

  void read_away(std::size_t size_so_far) {
    if (size_so_far > farewell_size_max) return;
    stream_.async_read_some(asio::buffer(discarded_), [self = shared_from_this(), size_so_far](
                                                          ErrorCode error, std::size_t size) {
      if (!error) self->read_away(size_so_far + size);
    });
  }

  Shared& shared_;
  std::string client_;
  beast::tcp_stream stream_;
  asio::steady_timer timer_;
  beast::flat_buffer buffer_{65'536};  // At most; of one request and the beginning of the next.
  std::optional<Parser> parser_;
  HttpRequest request_;
  std::chrono::steady_clock::time_point asked_at_;
  http::response<http::string_body> response_;
  std::optional<http::response_serializer<http::string_body>> serializer_;
  std::array<char, 4096> discarded_{};
  bool is_head_ = false;
  bool is_last_ = false;  ///< The connection ends after this answer.
  bool is_answering_ = false;
  bool is_trusted_ = false;  ///< A request has shown the token.
};

/// Closes the connection that is missed least, so that those that ask nothing cannot keep others
/// out: of the least worth, of the client that has most of them, the oldest. False if none may be.
bool make_room(const Shared& shared) {
  using Worth = Session::Worth;
  for (const Worth worth : {Worth::silent, Worth::answering, Worth::trusted_silent}) {
    std::map<std::string, std::size_t> counts;
    for (const Session* one : shared.sessions) {
      if (one->worth() == worth) ++counts[one->client()];
    }
    if (counts.empty()) continue;
    const std::size_t most = std::ranges::max(counts | std::views::values);
    const auto oldest = std::ranges::find_if(shared.sessions, [&](const Session* one) {
      return one->worth() == worth && counts.at(one->client()) == most;
    });
    (*oldest)->close();
    return true;
  }
  return false;
}

[[noreturn]] void refuse_address(const HttpConfig& config, const std::string& reason) {
  throw Error(fmt::format("page = {}:{} ({})", config.host, config.port, reason));
}

tcp::endpoint endpoint_of(const HttpConfig& config) {
  ErrorCode error;
  const asio::ip::address address = asio::ip::make_address(config.host, error);
  if (error) refuse_address(config, "is no address");
  return {address, config.port};
}

/// No program that this process starts may keep the connection open. The library does not say so
/// when it makes the descriptor.
void keep_from_children(int descriptor) { (void)fcntl(descriptor, F_SETFD, FD_CLOEXEC); }

}  // namespace

HttpAnswer plain_answer(unsigned status, std::string_view text) {
  return {.status = status,
          .content_type = "text/plain; charset=utf-8",
          .body = fmt::format("{}\n", text)};
}

struct HttpServer::Impl {
  Impl(const HttpConfig& config, Handler handler) : acceptor(context), pause(context) {
    shared.config = config;
    shared.handler = std::move(handler);
    listen();
    thread = std::thread([this] {
      sigset_t all;  // Signals are for the other threads of the process.
      sigfillset(&all);
      pthread_sigmask(SIG_SETMASK, &all, nullptr);
      context.run();
    });
  }
  ~Impl() {
    context.stop();
    thread.join();
  }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void listen() {
    const tcp::endpoint endpoint = endpoint_of(shared.config);
    try {
      acceptor.open(endpoint.protocol());
      keep_from_children(acceptor.native_handle());
      acceptor.set_option(tcp::acceptor::reuse_address(true));
      acceptor.bind(endpoint);
      acceptor.listen(backlog);
      port = acceptor.local_endpoint().port();
    } catch (const boost::system::system_error& error) {
      refuse_address(shared.config, error.code().message());
    }
    accept();
  }

  void accept() {
    acceptor.async_accept([this](ErrorCode error, tcp::socket socket) {
      if (!error) serve(std::move(socket));
      if (!error || error == asio::error::connection_aborted) return accept();
      // No descriptor is left: the next attempt would fail at once.
      pause.expires_after(accept_again_after);
      pause.async_wait([this](ErrorCode stopped) {
        if (!stopped) accept();
      });
    });
  }

  void serve(tcp::socket socket) {
    keep_from_children(socket.native_handle());
    const bool is_full = shared.sessions.size() >= shared.config.num_connections_max;
    if (is_full) ++shared.num_refused;
    if (!is_full || make_room(shared)) {
      std::make_shared<Session>(std::move(socket), shared)
          ->begin(shared.config.request_duration_max);
      return;
    }
    constexpr std::string_view refusal =
        "HTTP/1.1 503 Service Unavailable\r\nContent-Length: 0\r\nRetry-After: 5\r\n"
        "Connection: close\r\n\r\n";
    ErrorCode ignored;
    socket.non_blocking(true, ignored);
    socket.write_some(asio::buffer(refusal), ignored);
  }

  Shared shared;
  asio::io_context context{1};  // Ends before what its connections use.
  tcp::acceptor acceptor;
  asio::steady_timer pause;
  std::uint16_t port = 0;
  std::thread thread;
};

HttpServer::HttpServer(const HttpConfig& config, Handler handler)
    : impl_(std::make_unique<Impl>(config, std::move(handler))) {}

HttpServer::~HttpServer() = default;

std::uint16_t HttpServer::port() const { return impl_->port; }

HttpCounts HttpServer::counts() const {
  const Shared& shared = impl_->shared;
  return {.num_connections = shared.num_connections,
          .num_requests = shared.num_requests,
          .num_refused = shared.num_refused};
}

}  // namespace proofmass::coordinator
