# Puts a text file into a C++ source: cmake -D IN=index.html -D OUT=page.cc -D NAME=kLivePage -P embed.cmake
cmake_minimum_required(VERSION 3.25)
file(READ ${IN} text)
file(WRITE ${OUT} "#include \"services/gateway/gateway.h\"\n\nnamespace flamefield {\n\n\
const std::string_view ${NAME} = R\"embedded(${text})embedded\";\n\n}  // namespace flamefield\n")
