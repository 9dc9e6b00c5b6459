# Puts recipes into a C++ source: cmake -D FOLDER=deploy/recipes -D OUT=shipped.cc -P embed_recipes.cmake
cmake_minimum_required(VERSION 3.25)
file(GLOB files ${FOLDER}/*.toml)
set(rows "")
foreach(file IN LISTS files)
  get_filename_component(name ${file} NAME_WE)
  file(READ ${file} text)
  string(APPEND rows "    {\"${name}\", R\"embedded(${text})embedded\"},\n")
endforeach()
file(WRITE ${OUT} "#include \"services/study/shipped.h\"\n\nnamespace flamefield {\n\n\
std::span<const ShippedRecipe> shipped_recipes() {\n  static constexpr ShippedRecipe kRecipes[] = {\n${rows}  };\n\
  return kRecipes;\n}\n\n}  // namespace flamefield\n")
