# Puts the built front end into the program: cmake -D DIST=folder -D OPENAPI=openapi.json -D OUT=web_files.cc -P embed_web.cmake
# The assembler reads the files: a megabyte as C++ text would take the compiler longer than all else here.
cmake_minimum_required(VERSION 3.25)
file(GLOB_RECURSE files LIST_DIRECTORIES false RELATIVE ${DIST} ${DIST}/*)
list(SORT files)
set(blobs "")
set(symbols "")
set(table "")
set(number 0)
function(add_blob symbol path)
  string(APPEND blobs "asm(\".section .rodata\\n.balign 8\\n${symbol}: .incbin \\\"${path}\\\"\\n${symbol}_end:\\n.byte 0\\n.previous\\n\");\n")
  string(APPEND symbols "extern \"C\" __attribute__((visibility(\"hidden\"))) const char ${symbol}[], ${symbol}_end[];\n")
  set(blobs "${blobs}" PARENT_SCOPE)
  set(symbols "${symbols}" PARENT_SCOPE)
endfunction()
foreach(file ${files})
  set(symbol flamefield_web_${number})
  add_blob(${symbol} ${DIST}/${file})
  set(gzip false)
  if(file MATCHES "\\.gz$")
    set(gzip true)
  endif()
  string(REGEX REPLACE "\\.gz$" "" path ${file})
  string(APPEND table "    {\"/${path}\", between(${symbol}, ${symbol}_end), ${gzip}},\n")
  math(EXPR number "${number} + 1")
endforeach()
add_blob(flamefield_web_openapi ${OPENAPI})
file(WRITE ${OUT} "#include \"services/gateway/web_files.h\"\n\n#include <array>\n\n${blobs}${symbols}
namespace flamefield {
namespace {
std::string_view between(const char* begin, const char* end) {
  return {begin, static_cast<std::size_t>(end - begin)};
}
}  // namespace

std::span<const WebFile> web_files() {
  static const std::array<WebFile, ${number}> kFiles = {{
${table}  }};
  return kFiles;
}

std::string_view openapi_json() {
  return between(flamefield_web_openapi, flamefield_web_openapi_end);
}

}  // namespace flamefield\n")
