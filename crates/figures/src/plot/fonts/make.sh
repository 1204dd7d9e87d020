#!/bin/sh
# Makes the fonts of this folder. Needs `pip install fonttools` and `apt install fonts-dejavu-core`.
set -eu
cd "$(dirname "$0")"
latin=U+20-7E,U+A0-17F,U+2C6,U+2DC
greek=U+370-3FF
accents=U+302,U+303,U+307,U+308
punctuation=U+2010-2015,U+2018-201F,U+2022,U+2026,U+2030,U+2032,U+2033
scripts=U+1D62-1D6A,U+2070-2094,U+2C7C
letterlike=U+2102,U+2111,U+211C,U+2126,U+212B
arrows=U+2190-2193
operators=U+2202,U+2206,U+2207,U+2211-2213,U+2215,U+2219,U+221A,U+221D,U+221E,U+2220,U+2225,U+222B
relations=U+2248,U+2260,U+2261,U+2264,U+2265,U+226A,U+226B,U+22C5
brackets=U+2308-230B,U+27E8,U+27E9
for font in DejaVuSans DejaVuSans-Bold; do
    pyftsubset "/usr/share/fonts/truetype/dejavu/$font.ttf" --output-file="$font-subset.ttf" \
        --unicodes="$latin,$greek,$accents,$punctuation,$scripts,$letterlike,$arrows,$operators,$relations,$brackets,U+FFFD" \
        --no-hinting --layout-features='' --drop-tables+=GSUB,GPOS,GDEF,MATH,kern,FFTM \
        --notdef-outline --name-IDs='*' --no-recalc-timestamp
done
