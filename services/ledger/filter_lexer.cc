#include "services/ledger/filter_lexer.h"

#include <cctype>

namespace flamefield {

namespace {

constexpr std::size_t kLongestFilter = 10'000;

// What names, numbers, times and patterns are made of.
bool is_word(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 ||
         std::string_view("_.-+:*?").find(c) != std::string_view::npos;
}

}  // namespace

tl::unexpected<Error> filter_fault(const Token& token, std::string_view why, std::string_view suggestion) {
  const std::string what = token.kind == TokenKind::End ? "the end" : concat("'", token.text, "'");
  return invalid_input(concat("filter, character ", token.at, ": ", what), why, suggestion);
}

Result<std::vector<Token>> filter_tokens(std::string_view text) {
  if (text.size() > kLongestFilter)
    return invalid_input("filter", concat("it is longer than ", kLongestFilter, " characters"), "shorten it");
  std::vector<Token> tokens;
  std::size_t i = 0;
  const auto push = [&](TokenKind kind, std::string_view word, std::size_t length) {
    tokens.push_back({kind, std::string(word), i + 1});
    i += length;
  };
  while (i < text.size()) {
    const char c = text[i];
    const std::string_view rest = text.substr(i);
    if (std::isspace(static_cast<unsigned char>(c)) != 0) {
      ++i;
    } else if (c == '(') {
      push(TokenKind::Open, "(", 1);
    } else if (c == ')') {
      push(TokenKind::Close, ")", 1);
    } else if (c == ',') {
      push(TokenKind::Comma, ",", 1);
    } else if (c == '\'' || c == '"') {
      const std::size_t end = text.find(c, i + 1);
      if (end == std::string_view::npos)
        return filter_fault({TokenKind::Word, std::string(rest.substr(0, 20)), i + 1}, "this text has no end",
                            concat("close it with ", c));
      push(TokenKind::Quoted, text.substr(i + 1, end - i - 1), end - i + 1);
    } else if (rest.starts_with("!=") || rest.starts_with("<=") || rest.starts_with(">=") ||
               rest.starts_with("!~")) {
      push(TokenKind::Operator, rest.substr(0, 2), 2);
    } else if (c == '=' || c == '<' || c == '>' || c == '~') {
      push(TokenKind::Operator, rest.substr(0, 1), 1);
    } else if (is_word(c)) {
      std::size_t n = 1;
      while (n < rest.size() && is_word(rest[n])) ++n;
      push(TokenKind::Word, rest.substr(0, n), n);
    } else {
      return filter_fault({TokenKind::Word, std::string(1, c), i + 1}, "it means nothing here",
                          "put texts between quotation marks");
    }
  }
  tokens.push_back({TokenKind::End, "", text.size() + 1});
  return tokens;
}

}  // namespace flamefield
