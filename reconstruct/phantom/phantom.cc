#include "reconstruct/phantom/phantom.h"

#include <array>

#include "proto/check.h"
#include "reconstruct/phantom/flame.h"

namespace flamefield {

namespace {

struct Row {
  PhantomKind kind;
  std::string_view name;
};
constexpr std::array kRows = {
    Row{PhantomKind::Torus, "torus"},       Row{PhantomKind::HollowSphere, "hollow-sphere"},
    Row{PhantomKind::Gaussian, "gaussian"}, Row{PhantomKind::Bunsen, "bunsen"},
    Row{PhantomKind::Swirl, "swirl"},       Row{PhantomKind::Stratified, "stratified"}};

}  // namespace

std::string_view name_of(PhantomKind kind) {
  for (const Row& row : kRows)
    if (row.kind == kind) return row.name;
  return "unknown";
}

bool evolves(PhantomKind kind) {
  return kind == PhantomKind::Bunsen || kind == PhantomKind::Swirl || kind == PhantomKind::Stratified;
}

std::optional<PhantomKind> phantom_kind_from_name(std::string_view name) {
  for (const Row& row : kRows)
    if (row.name == name) return row.kind;
  return std::nullopt;
}

Volume make_phantom(const PhantomOptions& options, const Grid& grid) {
  expect(validate(grid).has_value(), "the grid of a phantom is valid");
  switch (options.kind) {
    case PhantomKind::Torus:
      return make_torus(grid);
    case PhantomKind::HollowSphere:
      return make_hollow_sphere(grid);
    case PhantomKind::Gaussian:
      return make_gaussian(grid);
    case PhantomKind::Bunsen:
      return make_bunsen(options, grid);
    case PhantomKind::Swirl:
      return make_swirl(options, grid);
    case PhantomKind::Stratified:
      return make_stratified(options, grid);
  }
  return Volume(grid);
}

}  // namespace flamefield
