# mapmend_embed_text(TARGET HEADER NAME FILE [PART ...]): HEADER, in the target's include path, defines
# mapmend::NAME as the text of FILE, in which @PART@ stands for the text of the file PART beside it.
function(mapmend_embed_text target header name file)
  file(READ ${CMAKE_CURRENT_SOURCE_DIR}/${file} text)
  set(sources ${CMAKE_CURRENT_SOURCE_DIR}/${file})
  get_filename_component(folder ${CMAKE_CURRENT_SOURCE_DIR}/${file} DIRECTORY)
  foreach(part ${ARGN})
    file(READ ${folder}/${part} content)
    string(REPLACE "@${part}@" "${content}" text "${text}")
    list(APPEND sources ${folder}/${part})
  endforeach()
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${sources})
  file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/embedded/${header} @ONLY CONTENT
"#pragma once

// Made of @file@; change that.
namespace mapmend {

inline constexpr char @name@[] = R\"embedded(@text@)embedded\";

}  // namespace mapmend
")
  target_include_directories(${target} SYSTEM PRIVATE ${CMAKE_CURRENT_BINARY_DIR}/embedded)
endfunction()

# mapmend_embed_folder(TARGET HEADER NAME ROOT FOLDER): HEADER, in the target's include path, defines mapmend::NAME, an
# array of {path, content} of every file in FOLDER below ROOT; the paths are those below ROOT, with a slash in front.
function(mapmend_embed_folder target header name root folder)
  file(GLOB files CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR}/${root}
       ${CMAKE_CURRENT_SOURCE_DIR}/${root}/${folder}/*)
  set(entries "")
  foreach(file ${files})
    file(READ ${CMAKE_CURRENT_SOURCE_DIR}/${root}/${file} content)
    string(APPEND entries "    {\"/${file}\", R\"embedded(${content})embedded\"},\n")
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${root}/${file})
  endforeach()
  file(CONFIGURE OUTPUT ${CMAKE_CURRENT_BINARY_DIR}/embedded/${header} @ONLY CONTENT
"#pragma once

#include <string_view>

// Made of the files in @root@/@folder@; change those.
namespace mapmend {

struct EmbeddedFile {
  std::string_view path, content;
};

inline constexpr EmbeddedFile @name@[] = {
@entries@};

}  // namespace mapmend
")
  target_include_directories(${target} SYSTEM PRIVATE ${CMAKE_CURRENT_BINARY_DIR}/embedded)
endfunction()
