mod arm;
mod backbones;
mod early;
mod textbook;
mod work;
