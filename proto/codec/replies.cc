// Errors, replies without contents, and news.
#include "proto/codec/wire.h"

namespace flamefield {

void write(const Error& error, v1::Error* wire) {
  wire->set_code(std::string(name_of(error.code)));
  wire->set_message(error.message);
}

void read(const v1::Error& wire, Error& error, Check& check) {
  error.message = wire.message();
  read_enum(wire.code(),
            one_of(wire.code(), {ErrorCode::InvalidInput, ErrorCode::NotFound, ErrorCode::Unavailable,
                                 ErrorCode::DataLoss}),
            error.code, "error code", check);
}

void write(const Accepted&, v1::Accepted*) {}
void read(const v1::Accepted&, Accepted&, Check&) {}

void write(const Rejected& m, v1::Rejected* wire) {
  write(m.error, wire->mutable_error());
}
void read(const v1::Rejected& wire, Rejected& m, Check& check) {
  read(wire.error(), m.error, check);
}

void write(const Event& m, v1::Event* wire) {
  wire->set_time_ns(m.time_ns);
  wire->set_kind(m.kind);
  wire->set_subject(m.subject);
  wire->set_text(m.text);
}
void read(const v1::Event& wire, Event& m, Check&) {
  m = {wire.time_ns(), wire.kind(), wire.subject(), wire.text()};
}

}  // namespace flamefield
