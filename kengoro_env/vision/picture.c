/* Converts the pixels that GL reads to an image. Called by quick_renderer.py. */

#include <stdint.h>
#include <string.h>

enum { AT_ONCE = 16 }; /* number of pixels that are tested together */

static uint64_t two(const uint32_t* pixels) {
  uint64_t pair;
  memcpy(&pair, pixels, sizeof pair);
  return pair;
}

static uint64_t without_alpha(uint64_t pair) {
  return (pair & 0xffffffu) | (pair >> 8 & 0xffffff000000u);
}

/* A pair of pixels, replaced by `behind` where nothing was rendered (alpha is 0). */
static uint64_t before(uint64_t pair, uint64_t behind) {
  uint64_t mask = (pair >> 31 & 0x100000001u) * 0xffffffffu;
  return (pair & mask) | (behind & ~mask);
}

/* Write the image (height, width, 3) of pixels (height, width) with red, green, blue and alpha.
   GL reads the lowest row first. With `fill`, pixels where nothing was rendered (alpha is 0) become
   `background`, a colour in the format of a pixel. */
void to_picture(
    const uint32_t* pixels, int64_t width, int64_t height, int fill, uint32_t background,
    uint8_t* picture) {
  const uint64_t rendered = fill ? 0x8000000080000000u : 0;
  const uint64_t behind = background | (uint64_t)background << 32;
  uint8_t all_behind[3 * AT_ONCE];
  for (int i = 0; i < AT_ONCE; i++) memcpy(all_behind + 3 * i, &background, 3);
  for (int64_t y = 0; y < height; y++) {
    const uint32_t* from = pixels + (height - 1 - y) * width;
    uint8_t* to = picture + 3 * y * width;
    int64_t x = 0;
    for (; x + AT_ONCE <= width; x += AT_ONCE, to += 3 * AT_ONCE) {
      uint64_t any = !fill;
      for (int i = 0; i < AT_ONCE; i += 2) any |= two(from + x + i);
      if (!any) { /* the usual case */
        memcpy(to, all_behind, sizeof all_behind);
        continue;
      }
      for (int i = 0; i < AT_ONCE; i += 4) {
        uint64_t first = two(from + x + i), second = two(from + x + i + 2);
        if ((first & second & rendered) != rendered) {
          first = before(first, behind);
          second = before(second, behind);
        }
        first = without_alpha(first);
        second = without_alpha(second);
        uint64_t low = first | second << 48;
        uint32_t high = (uint32_t)(second >> 16);
        memcpy(to + 3 * i, &low, 8);
        memcpy(to + 3 * i + 8, &high, 4);
      }
    }
    for (; x < width; x++, to += 3) {
      uint32_t pixel = !fill || from[x] >> 31 ? from[x] : background;
      memcpy(to, &pixel, 3);
    }
  }
}
