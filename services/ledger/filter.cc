#include "services/ledger/filter.h"

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>

#include "proto/nearest_name.h"
#include "services/ledger/filter_fields.h"
#include "services/ledger/filter_lexer.h"

namespace flamefield {

namespace {

constexpr int kDeepest = 64;
constexpr std::size_t kMostValues = 500;

std::optional<double> number_of(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::optional<int> digits(std::string_view text, std::size_t at, std::size_t count) {
  if (at + count > text.size()) return std::nullopt;
  int value = 0;
  for (char c : text.substr(at, count)) {
    if (c < '0' || c > '9') return std::nullopt;
    value = 10 * value + (c - '0');
  }
  return value;
}

// "-90d" and the like, in ns; the longest span is 100 years.
std::optional<std::int64_t> span_ns(std::string_view text) {
  static constexpr std::pair<std::string_view, double> kUnits[] = {
      {"min", 60}, {"s", 1}, {"h", 3600}, {"d", 86'400}, {"w", 604'800}};
  for (const auto& [unit, seconds] : kUnits) {
    if (!text.ends_with(unit)) continue;
    const auto count = number_of(text.substr(0, text.size() - unit.size()));
    if (count && std::abs(*count * seconds) < 100 * 365.25 * 86'400)
      return static_cast<std::int64_t>(*count * seconds * 1e9);
  }
  return std::nullopt;
}

// "2026-03-01", with "T10:15", ":30" and "Z" added as far as wanted.
std::optional<std::int64_t> date_ns(std::string_view text) {
  using namespace std::chrono;
  if (text.ends_with('Z')) text.remove_suffix(1);
  const auto y = digits(text, 0, 4), m = digits(text, 5, 2), d = digits(text, 8, 2);
  if (!y || !m || !d || text[4] != '-' || text[7] != '-') return std::nullopt;
  const year_month_day date{year(*y), month(static_cast<unsigned>(*m)), day(static_cast<unsigned>(*d))};
  if (!date.ok() || *y < 1970 || *y > 2200) return std::nullopt;
  seconds time{0};
  if (text.size() > 10) {
    const auto hour = digits(text, 11, 2), minute = digits(text, 14, 2);
    const bool has_seconds = text.size() > 16;
    const auto second = has_seconds ? digits(text, 17, 2) : std::optional(0);
    const bool shaped = text[10] == 'T' && text.size() == (has_seconds ? 19u : 16u) && text[13] == ':' &&
                        (!has_seconds || text[16] == ':');
    if (!hour || !minute || !second || !shaped || *hour > 23 || *minute > 59 || *second > 59)
      return std::nullopt;
    time = hours(*hour) + minutes(*minute) + seconds(*second);
  }
  return duration_cast<nanoseconds>(sys_days(date).time_since_epoch() + time).count();
}

std::vector<std::string_view> words_of(std::string_view field) {
  if (field == "state") return {"queued", "leased", "done", "failed"};
  if (field == "kind") return {"dark", "background", "flat", "board", "burst", "live"};
  return {};
}

// Recursive descent over the grammar in the header; each function leaves `x_next` behind what it took.
class Parser {
 public:
  Parser(std::vector<Token> tokens, std::int64_t now_ns, FilterOver over)
      : tokens_(std::move(tokens)), now_ns_(now_ns), over_(over) {
    // Decided beforehand, since it changes where every field is found.
    filter_.mentions_state = std::ranges::any_of(
        tokens_, [](const Token& t) { return t.kind == TokenKind::Word && t.text == "state"; });
  }

  Result<Filter> parse() {
    if (token().kind == TokenKind::End) return Filter{};
    auto condition = alternatives(0);
    if (!condition) return tl::unexpected(condition.error());
    if (token().kind != TokenKind::End)
      return filter_fault(token(), "a condition ended before it", "join conditions with 'and' or 'or'");
    filter_.condition = std::move(*condition);
    return std::move(filter_);
  }

 private:
  const Token& token() const { return tokens_[next_]; }
  bool take_word(std::string_view word) {
    const bool is_it = token().kind == TokenKind::Word && token().text == word;
    if (is_it) ++next_;
    return is_it;
  }
  Result<std::string> joined(int depth, std::string_view word, std::string_view sql,
                             Result<std::string> (Parser::*part)(int)) {
    auto all = (this->*part)(depth);
    while (all && take_word(word)) {
      const auto next = (this->*part)(depth);
      if (!next) return next;
      *all = concat("(", *all, sql, *next, ")");
    }
    return all;
  }
  Result<std::string> alternatives(int depth) { return joined(depth, "or", " OR ", &Parser::conjunction); }
  Result<std::string> conjunction(int depth) { return joined(depth, "and", " AND ", &Parser::unit); }
  Result<std::string> unit(int depth);
  Result<const FilterField*> field();
  Result<std::string> comparison(const FilterField& field, const Token& name);
  Result<std::string> value(const FilterField& field);
  Result<std::string> values(const FilterField& field);
  static std::string tagged(const std::string& subjects, const std::string& condition, bool is_negated);
  std::string bound(FilterValue value) {
    filter_.values.push_back(std::move(value));
    return concat("?", filter_.values.size());
  }

  std::vector<Token> tokens_;
  std::size_t next_ = 0;
  std::int64_t now_ns_;
  FilterOver over_;
  Filter filter_;
};

Result<std::string> Parser::unit(int depth) {
  if (depth > kDeepest)
    return filter_fault(token(), "conditions lie too deep in each other", "simplify them");
  if (take_word("not")) {
    const auto inner = unit(depth + 1);
    if (!inner) return inner;
    return concat("NOT coalesce(", *inner, ", 0)");
  }
  if (token().kind == TokenKind::Open) {
    ++next_;
    const auto inner = alternatives(depth + 1);
    if (!inner) return inner;
    if (token().kind != TokenKind::Close)
      return filter_fault(token(), "a ')' is missing before it", "add it");
    ++next_;
    return concat("(", *inner, ")");
  }
  const Token name = token();
  const auto found = field();
  if (!found) return tl::unexpected(found.error());
  return comparison(**found, name);
}

Result<const FilterField*> Parser::field() {
  const Token& name = token();
  if (name.kind != TokenKind::Word)
    return filter_fault(name, "a field's name belongs here", "e.g. residual > 0.1");
  const std::string wanted = name.text.starts_with("metric.") ? "metric" : name.text;
  const auto fields = filter_fields();
  const auto found = std::ranges::find(fields, wanted, &FilterField::name);
  if (found == fields.end()) {
    std::vector<std::string_view> names;
    for (const FilterField& field : fields) names.push_back(field.name);
    return filter_fault(name, "there is no field of this name",
                        concat("did you mean '", nearest_name(wanted, names), "'?"));
  }
  if (found->type == FieldType::Metric && (name.text.size() <= 7 || name.text.size() > 100))
    return filter_fault(name, "it does not say which metric", "e.g. metric.pearson_3d");
  if (found->is_of_runs && over_ == FilterOver::Sets)
    return filter_fault(name, "it is a field of runs", "use one of sets: capture kind index pulse time");
  ++next_;
  filter_.mentions_runs = filter_.mentions_runs || found->is_of_runs;
  return &*found;
}

Result<std::string> Parser::comparison(const FilterField& field, const Token& name) {
  const bool is_done_only = over_ == FilterOver::Runs && !filter_.mentions_state;
  std::string left(is_done_only ? field.done_sql : field.any_sql);
  if (field.type == FieldType::Truth) return left;
  if (field.type == FieldType::Tag && over_ == FilterOver::Sets) left = "s.capture";
  if (field.type == FieldType::Metric)
    left = concat("(SELECT m.value FROM run_metrics m WHERE m.run_id = r.id AND m.name = ",
                  bound(name.text.substr(7)), ")");
  const Token op = token();
  const bool is_list = take_word("in");
  if (!is_list) {
    if (op.kind != TokenKind::Operator)
      return filter_fault(op, concat("after '", name.text, "' comes a comparison"),
                          "one of = != < <= > >= ~ in");
    ++next_;
  }
  const bool is_text = field.type == FieldType::Text || field.type == FieldType::Tag;
  const bool is_order = op.text.find_first_of("<>") != std::string::npos;
  const bool is_pattern = op.text.find('~') != std::string::npos;
  if (!is_list && ((is_text && is_order) || (!is_text && is_pattern)))
    return filter_fault(op, concat("'", field.name, "' is no ", is_text ? "number" : "text"),
                        is_text ? "use = != ~ or in" : "use = != < <= > >= or in");
  const auto right = is_list ? values(field) : value(field);
  if (!right) return right;
  const bool is_negated = op.text.starts_with('!');
  const std::string_view compared = is_list ? " IN " : is_pattern ? " GLOB " : is_text ? " = " : "";
  if (field.type == FieldType::Tag) return tagged(left, concat(compared, *right), is_negated);
  if (is_text) return concat(is_negated ? "NOT " : "", "(", left, compared, *right, ")");
  return concat("(", left, is_list ? std::string(" IN ") : concat(" ", op.text, " "), *right, ")");
}

// Whether one of the subjects ("r.capture, r.id") carries such a tag; the tagged ones are looked up once.
std::string Parser::tagged(const std::string& subjects, const std::string& condition, bool is_negated) {
  const std::string tagged_ones = concat(" IN (SELECT t.subject FROM tags t WHERE t.tag", condition, ")");
  const std::size_t comma = subjects.find(',');
  const std::string first = subjects.substr(0, comma) + tagged_ones;
  const std::string text = comma == std::string::npos
                               ? first
                               : concat("(", first, " OR ", subjects.substr(comma + 2), tagged_ones, ")");
  return is_negated ? concat("NOT ", text) : text;
}

Result<std::string> Parser::values(const FilterField& field) {
  if (token().kind != TokenKind::Open)
    return filter_fault(token(), "a list belongs here", "e.g. (mlem, map)");
  std::string list;
  do {
    ++next_;
    const auto one = value(field);
    if (!one) return one;
    list += (list.empty() ? "(" : ", ") + *one;
  } while (token().kind == TokenKind::Comma);
  if (token().kind != TokenKind::Close) return filter_fault(token(), "a ')' is missing before it", "add it");
  ++next_;
  return list + ")";
}

Result<std::string> Parser::value(const FilterField& field) {
  const Token given = token();
  if (given.kind != TokenKind::Word && given.kind != TokenKind::Quoted)
    return filter_fault(given, "a value belongs here", "put texts between quotation marks");
  if (filter_.values.size() >= kMostValues)
    return filter_fault(given, concat("a filter has at most ", kMostValues, " values"), "use patterns");
  ++next_;
  switch (field.type) {
    case FieldType::Number:
    case FieldType::Metric:
      if (const auto number = number_of(given.text)) return bound(*number);
      return filter_fault(given, concat("'", field.name, "' is compared with a number"), "e.g. 0.1");
    case FieldType::Time: {
      if (given.text == "now") return bound(now_ns_);
      if (const auto span = span_ns(given.text)) return bound(now_ns_ + *span);
      if (const auto date = date_ns(given.text)) return bound(*date);
      return filter_fault(given, "it is no time", "e.g. 2026-03-01, 2026-03-01T10:15 (UTC), -2h, -90d, now");
    }
    case FieldType::Text:
    case FieldType::Tag:
    case FieldType::Truth:
      break;
  }
  const auto words = words_of(field.name);
  const bool is_pattern = given.text.find_first_of("*?") != std::string::npos;
  if (!words.empty() && !is_pattern && std::ranges::find(words, given.text) == words.end())
    return filter_fault(given, concat("no ", field.name, " is called so"),
                        concat("did you mean '", nearest_name(given.text, words), "'?"));
  return bound(given.text);
}

}  // namespace

Result<Filter> parse_filter(std::string_view text, std::int64_t now_ns, FilterOver over) {
  auto tokens = filter_tokens(text);
  if (!tokens) return tl::unexpected(tokens.error());
  return Parser(std::move(*tokens), now_ns, over).parse();
}

std::string filter_help() {
  std::string text;
  for (const FilterField& field : filter_fields()) {
    const char* type = field.type == FieldType::Text || field.type == FieldType::Tag ? "text"
                       : field.type == FieldType::Time                               ? "time"
                       : field.type == FieldType::Truth                              ? "alone"
                                                                                     : "number";
    std::string name(field.name);
    name.resize(12, ' ');
    text += concat("  ", name, type, field.help.empty() ? "" : ", ", field.help, "\n");
  }
  return text;
}

}  // namespace flamefield
