// The only file that includes Boost.Beast: it takes a minute to compile.
#include "services/gateway/http_server.h"

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <thread>
#include <vector>

namespace flamefield {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
namespace net = boost::asio;
using tcp = net::ip::tcp;

// A reader must take in at least this much of a file on average, or it is cut off.
constexpr double kSlowestReader_bytes_per_s = 100e3;

std::chrono::milliseconds after(double seconds) {
  return std::chrono::milliseconds(static_cast<std::int64_t>(1e3 * seconds));
}

HttpResponse plain_error(int status, const std::string& message) {
  return {.status = status,
          .content_type = "text/plain; charset=utf-8",
          .body = message + "\n",
          .file = {},
          .headers = {}};
}

struct Shared {
  HttpServerOptions options;
  HttpHandler handler;
  std::atomic<int> connections = 0;
};

// One connection: read a request, answer, again. All its work is on one strand.
class Session : public std::enable_shared_from_this<Session> {
 public:
  Session(tcp::socket socket, Shared& shared) : stream_(std::move(socket)), shared_(shared) {
    ++shared_.connections;
  }
  ~Session() { --shared_.connections; }
  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  void start() {
    net::dispatch(stream_.get_executor(), [self = shared_from_this()] { self->read(); });
  }

 private:
  void read() {
    parser_.emplace();
    parser_->header_limit(shared_.options.max_header_bytes);
    parser_->body_limit(shared_.options.max_body_bytes);
    stream_.expires_after(after(shared_.options.timeout_s));
    http::async_read(
        stream_, buffer_, *parser_,
        [self = shared_from_this()](beast::error_code error, std::size_t) { self->on_read(error); });
  }

  void on_read(beast::error_code error) {
    if (!error) return answer(respond(), parser_->get().keep_alive());
    if (error == http::error::end_of_stream || error == beast::error::timeout) return close();
    if (error == http::error::header_limit) {
      return answer(plain_error(431, "request header too large (the limit is in the configuration)"), false);
    }
    if (error == http::error::body_limit) {
      return answer(plain_error(413, "request body too large (nothing here takes one)"), false);
    }
    if (error.category() == http::make_error_code(http::error::bad_target).category()) {
      return answer(plain_error(400, "not an HTTP request: " + error.message()), false);
    }
    close();
  }

  HttpResponse respond() {
    const auto& message = parser_->get();
    const std::string target(message.target());
    const std::size_t question = target.find('?');
    const auto path = percent_decoded(target.substr(0, question));
    if (!path || path->empty() || path->front() != '/') return plain_error(400, "bad path");
    HttpRequest request{std::string(message.method_string()), *path,
                        question == std::string::npos ? "" : target.substr(question + 1)};
    try {
      return shared_.handler(request);
    } catch (const std::exception& e) {
      return plain_error(500, concat("the gateway failed: ", e.what()));
    }
  }

  template <class Body>
  void write(http::response<Body> message, const HttpResponse& response, bool keep_alive, double timeout_s) {
    message.result(static_cast<unsigned>(response.status));
    message.version(11);
    message.set(http::field::server, "flamefield");
    message.set(http::field::content_type, response.content_type);
    for (const auto& [name, value] : response.headers) message.set(name, value);
    message.keep_alive(keep_alive);
    message.prepare_payload();
    stream_.expires_after(after(timeout_s));
    const auto kept = std::make_shared<http::response<Body>>(std::move(message));
    http::async_write(stream_, *kept,
                      [self = shared_from_this(), kept, keep_alive](beast::error_code error, std::size_t) {
                        if (error || !keep_alive) return self->close();
                        self->read();
                      });
  }

  void answer(const HttpResponse& response, bool keep_alive) {
    if (!response.file) {
      http::response<http::string_body> message;
      message.body() = response.body;
      return write(std::move(message), response, keep_alive, shared_.options.timeout_s);
    }
    http::response<http::file_body> message;
    beast::error_code error;
    message.body().open(response.file->c_str(), beast::file_mode::scan, error);
    if (error) return answer(plain_error(404, "no such file"), keep_alive);
    const double bytes = static_cast<double>(message.body().size());
    write(std::move(message), response, keep_alive,
          shared_.options.timeout_s + bytes / kSlowestReader_bytes_per_s);
  }

  // A socket closed with unread bytes is reset, and the client may never see our answer: what still comes is
  // thrown away until the client closes too, for a second at most.
  void close() {
    beast::error_code error;
    stream_.socket().shutdown(tcp::socket::shutdown_send, error);
    if (error) return;
    stream_.expires_after(std::chrono::seconds(1));
    discard();
  }
  void discard() {
    buffer_.clear();
    stream_.async_read_some(buffer_.prepare(4096),
                            [self = shared_from_this()](beast::error_code error, std::size_t) {
                              if (!error) self->discard();
                            });
  }

  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;
  std::optional<http::request_parser<http::string_body>> parser_;
  Shared& shared_;
};

}  // namespace

struct HttpServer::Impl {
  explicit Impl(HttpServerOptions o, HttpHandler h) : shared{std::move(o), std::move(h)} {}

  void accept() {
    acceptor.async_accept(net::make_strand(context), [this](beast::error_code error, tcp::socket socket) {
      if (error == net::error::operation_aborted) return;
      if (!error && shared.connections < shared.options.max_connections) {
        std::make_shared<Session>(std::move(socket), shared)->start();
      }
      if (!error) return accept();
      // Out of file descriptors, say: trying again at once would only burn the processor.
      retry.expires_after(std::chrono::milliseconds(100));
      retry.async_wait([this](beast::error_code cancelled) {
        if (!cancelled) accept();
      });
    });
  }

  Shared shared;  // outlives the sessions that the context holds
  net::io_context context;
  tcp::acceptor acceptor{net::make_strand(context)};
  net::steady_timer retry{acceptor.get_executor()};
};

HttpServer::HttpServer(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
HttpServer::~HttpServer() = default;

Result<std::unique_ptr<HttpServer>> HttpServer::listen(HttpServerOptions options, HttpHandler handler) {
  beast::error_code error;
  const std::string where = concat(options.address, ":", options.port);
  const auto address = net::ip::make_address(options.address, error);
  if (error) {
    return invalid_input(concat("cannot listen on ", where), "it is not a numeric address", "use 127.0.0.1");
  }
  const tcp::endpoint endpoint(address, options.port);
  auto impl = std::make_unique<Impl>(std::move(options), std::move(handler));
  tcp::acceptor& acceptor = impl->acceptor;
  acceptor.open(endpoint.protocol(), error);
  if (!error) acceptor.set_option(net::socket_base::reuse_address(true), error);
  if (!error) acceptor.bind(endpoint, error);
  if (!error) acceptor.listen(net::socket_base::max_listen_connections, error);
  if (error) {
    return unavailable(concat("cannot listen on ", where), error.message(),
                       "stop the other program or choose another port");
  }
  return std::unique_ptr<HttpServer>(new HttpServer(std::move(impl)));
}

std::uint16_t HttpServer::port() const {
  beast::error_code ignored;
  return impl_->acceptor.local_endpoint(ignored).port();
}

void HttpServer::run(std::stop_token stop) {
  net::dispatch(impl_->acceptor.get_executor(), [this] { impl_->accept(); });
  const std::stop_callback on_stop(stop, [this] { impl_->context.stop(); });
  std::vector<std::jthread> threads;
  for (int i = 1; i < impl_->shared.options.threads; ++i)
    threads.emplace_back([this] { impl_->context.run(); });
  impl_->context.run();
}

std::optional<std::string> percent_decoded(const std::string& text) {
  const auto digit = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] != '%') {
      out += text[i];
      continue;
    }
    if (i + 2 >= text.size() || digit(text[i + 1]) < 0 || digit(text[i + 2]) < 0) return std::nullopt;
    const int byte = 16 * digit(text[i + 1]) + digit(text[i + 2]);
    if (byte == 0) return std::nullopt;
    out += static_cast<char>(byte);
    i += 2;
  }
  return out;
}

}  // namespace flamefield
