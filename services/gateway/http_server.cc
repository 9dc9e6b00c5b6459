// The only file that includes Boost.Beast: it takes a minute to compile.
#include "services/gateway/http_server.h"

#include <atomic>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>
#include <boost/asio/strand.hpp>
#include <boost/asio/thread_pool.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <chrono>
#include <mutex>
#include <set>
#include <sstream>
#include <thread>
#include <vector>

namespace flamefield {
namespace {

namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;
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

class Watcher;

struct Shared {
  HttpServerOptions options;
  HttpHandler handler;
  std::atomic<int> connections = 0;
  net::thread_pool answering{2};  // handlers may block; sockets must not wait for them

  std::mutex mutex;
  std::set<Watcher*> watchers;  // all alive: each leaves before it dies
  void wake_watchers();
};

// Counts a connection while it lives, whichever protocol it speaks.
class Place {
 public:
  explicit Place(Shared& shared) : shared_(&shared) { ++shared.connections; }
  Place(Place&& other) noexcept : shared_(std::exchange(other.shared_, nullptr)) {}
  Place& operator=(Place&&) = delete;
  ~Place() {
    if (shared_) --shared_->connections;
  }

 private:
  Shared* shared_;
};

// One WebSocket. All its work is on one strand; at most one message is being written.
class Watcher : public std::enable_shared_from_this<Watcher> {
 public:
  Watcher(beast::tcp_stream stream, Place place, Shared& shared)
      : socket_(std::move(stream)),
        place_(std::move(place)),
        shared_(shared),
        board_(*shared.options.board) {}
  ~Watcher() {
    const std::scoped_lock lock(shared_.mutex);
    shared_.watchers.erase(this);
    for (const auto& [topic, version] : sent_) board_.unwatch(topic);
  }
  Watcher(const Watcher&) = delete;
  Watcher& operator=(const Watcher&) = delete;

  void start(const http::request<http::string_body>& request) {
    beast::get_lowest_layer(socket_).expires_never();  // the WebSocket has time limits of its own
    websocket::stream_base::timeout limits{after(shared_.options.timeout_s), after(shared_.options.timeout_s),
                                           true};
    socket_.set_option(limits);
    socket_.read_message_max(kLongestRequest_bytes);
    socket_.auto_fragment(false);
    beast::error_code ignored;
    beast::get_lowest_layer(socket_).socket().set_option(net::socket_base::send_buffer_size(1 << 18),
                                                         ignored);
    socket_.async_accept(request, [self = shared_from_this()](beast::error_code error) {
      if (error) return;
      {
        const std::scoped_lock lock(self->shared_.mutex);
        self->shared_.watchers.insert(self.get());
      }
      self->read();
    });
  }

  // From any thread, under the lock of `shared_`.
  void wake() {
    if (woken_.exchange(true)) return;
    // The reference moves on: dropped here as the last one, it would want the lock that wake_watchers()
    // holds.
    if (auto self = weak_from_this().lock()) {
      const auto executor = socket_.get_executor();
      net::post(executor, [self = std::move(self)] {
        self->woken_ = false;
        self->send_next();
      });
    }
  }

 private:
  static constexpr std::size_t kLongestRequest_bytes = 2048, kMostTopics = 16;
  static constexpr int kMostOnTheWay = 2;

  void read() {
    socket_.async_read(buffer_, [self = shared_from_this()](beast::error_code error, std::size_t) {
      if (error) return;  // closed, silent for too long, or no WebSocket frame
      self->obey(beast::buffers_to_string(self->buffer_.data()));
      self->buffer_.consume(self->buffer_.size());
      self->read();
    });
  }

  void obey(const std::string& line) {
    std::istringstream words(line);
    std::string word;
    words >> word;
    if (word == "got") on_the_way_ = std::max(0, on_the_way_ - 1);
    if (word == "want") {
      std::map<std::string, std::uint64_t> wanted;
      while (wanted.size() < kMostTopics && words >> word) {
        const auto known = sent_.find(word);
        wanted.emplace(word, known == sent_.end() ? 0 : known->second);
      }
      for (const auto& [topic, version] : wanted) board_.watch(topic);
      for (const auto& [topic, version] : sent_) board_.unwatch(topic);
      sent_ = std::move(wanted);
    }
    send_next();
  }

  // The wanted topic that has news and was served longest ago.
  void send_next() {
    if (writing_) return;
    const std::string* chosen = nullptr;
    NoticeBoard::Note note;
    for (const auto& [topic, version] : sent_) {
      const auto newest = board_.newest(topic);
      if (!newest || newest->version <= version) continue;
      if (newest->binary && on_the_way_ >= kMostOnTheWay) continue;
      if (chosen && sent_.at(*chosen) <= version) continue;
      chosen = &topic;
      note = *newest;
    }
    if (!chosen) return;
    sent_[*chosen] = note.version;
    if (note.binary) ++on_the_way_;
    writing_ = true;
    socket_.binary(note.binary);
    socket_.async_write(net::buffer(*note.bytes), [self = shared_from_this(), bytes = note.bytes](
                                                      beast::error_code error, std::size_t) {
      self->writing_ = false;
      if (!error) self->send_next();
    });
  }

  websocket::stream<beast::tcp_stream> socket_;
  const Place place_;
  Shared& shared_;
  NoticeBoard& board_;
  beast::flat_buffer buffer_;
  std::map<std::string, std::uint64_t> sent_;  // wanted topics with the version sent last
  int on_the_way_ = 0;                         // binary messages that the client has not dealt with
  bool writing_ = false;
  std::atomic<bool> woken_ = false;
};

void Shared::wake_watchers() {
  const std::scoped_lock lock(mutex);
  for (Watcher* watcher : watchers) watcher->wake();
}

// One connection: read a request, answer, again. All its work is on one strand.
class Session : public std::enable_shared_from_this<Session> {
 public:
  Session(tcp::socket socket, Shared& shared) : stream_(std::move(socket)), place_(shared), shared_(shared) {}

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
    if (!error) return respond();
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

  // Hands the request to the handler in a thread that may wait, and comes back to the socket's strand.
  void respond() {
    stream_.expires_never();
    net::post(shared_.answering, [self = shared_from_this()] {
      auto response = std::make_shared<HttpResponse>(self->handled());
      net::post(self->stream_.get_executor(), [self, response] {
        if (response->status == 101) return self->upgrade();
        self->answer(*response, self->parser_->get().keep_alive());
      });
    });
  }

  HttpResponse handled() {
    const auto& message = parser_->get();
    const std::string target(message.target());
    const std::size_t question = target.find('?');
    const auto path = percent_decoded(target.substr(0, question));
    if (!path || path->empty() || path->front() != '/') return plain_error(400, "bad path");
    HttpRequest request;
    request.method = std::string(message.method_string());
    request.path = *path;
    if (question != std::string::npos) request.query = target.substr(question + 1);
    for (const auto& field : message) {
      std::string name(field.name_string());
      for (char& c : name) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
      request.headers[name] = std::string(field.value());
    }
    request.body = message.body();
    try {
      return shared_.handler(request);
    } catch (const std::exception& e) {
      return plain_error(500, concat("the gateway failed: ", e.what()));
    }
  }

  void upgrade() {
    if (!shared_.options.board || !websocket::is_upgrade(parser_->get())) {
      return answer(plain_error(426, "this is a WebSocket"), false);
    }
    std::make_shared<Watcher>(std::move(stream_), std::move(place_), shared_)->start(parser_->get());
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
  Place place_;
  Shared& shared_;
};

}  // namespace

struct HttpServer::Impl {
  explicit Impl(HttpServerOptions o, HttpHandler h) {
    shared.options = std::move(o);
    shared.handler = std::move(h);
    if (shared.options.board) shared.options.board->on_post([this] { shared.wake_watchers(); });
  }
  ~Impl() {
    if (shared.options.board) shared.options.board->on_post({});
    shared.answering.stop();
    shared.answering.join();
  }

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
  threads.clear();
  impl_->shared.answering.stop();
  impl_->shared.answering.join();
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
