#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "proto/error.h"

// Known to this folder only: the words of the filter language.
namespace flamefield {

enum class TokenKind { Word, Quoted, Operator, Open, Close, Comma, End };

struct Token {
  TokenKind kind = TokenKind::End;
  std::string text;    // without quotation marks
  std::size_t at = 0;  // character, from 1
};

// The last one is End. InvalidInput: a text without end, or a character that means nothing here.
Result<std::vector<Token>> filter_tokens(std::string_view text);

// "filter, character 12: 'solvr' (why) suggestion"
tl::unexpected<Error> filter_fault(const Token& token, std::string_view why, std::string_view suggestion);

}  // namespace flamefield
